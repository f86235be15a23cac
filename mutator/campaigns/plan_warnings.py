"""Warns about experiments whose fault changes nothing."""

import warnings
from collections.abc import Sequence

from mutator._common.message_text import counted
from mutator.errors import MutatorWarning
from mutator.faults.fault_models import FaultModels
from mutator.model import Experiment, Fault

_NAMED = 3  # how many faults a warning names


class IdleValues:
    """Collects the faults whose value changes nothing, and counts their experiments."""

    def __init__(self, models: FaultModels) -> None:
        self._models = models
        self._labels: list[str] = []
        self._count = self._of = 0

    def add(self, experiments: Sequence[Experiment]) -> None:
        faults = {experiment.fault.id: experiment.fault for experiment in experiments}
        idle = {name: fault for name, fault in faults.items() if changes_nothing(fault, self._models)}
        self._labels += [fault.label for fault in idle.values()]
        self._count += sum(experiment.fault.id in idle for experiment in experiments) if idle else 0
        self._of += len(experiments)

    def warn(self) -> None:
        if labels := list(dict.fromkeys(self._labels)):
            more = f" and {len(labels) - _NAMED} more" if len(labels) > _NAMED else ""
            warnings.warn(
                f"the value changes nothing in {self._count} of {counted(self._of, 'experiment')}: "
                f"{', '.join(labels[:_NAMED])}{more}",
                MutatorWarning,
                stacklevel=2,
            )


def changes_nothing(fault: Fault, models: FaultModels) -> bool:
    return all(models.get(one.model).changes_nothing(dict(one.params)) for one in fault.injections)
