"""Warns about experiments whose fault changes nothing."""

import warnings
from collections.abc import Sequence

from mutator._common.message_text import counted
from mutator.errors import MutatorWarning
from mutator.faults.fault_models import FaultModels
from mutator.model import Experiment, Fault

_MOST_NAMED_FAULTS = 3  # how many faults a warning names


class IdleFaults:
    """Collects the faults whose value changes nothing, and counts their experiments."""

    def __init__(self, models: FaultModels) -> None:
        self._models = models
        self._idle_labels: list[str] = []
        self._idle_count = self._experiment_count = 0

    def add(self, experiments: Sequence[Experiment]) -> None:
        faults = {experiment.fault.id: experiment.fault for experiment in experiments}
        idle = {name: fault for name, fault in faults.items() if is_idle(fault, self._models)}
        self._idle_labels += [fault.label for fault in idle.values()]
        self._idle_count += sum(experiment.fault.id in idle for experiment in experiments) if idle else 0
        self._experiment_count += len(experiments)

    def warn(self) -> None:
        if labels := list(dict.fromkeys(self._idle_labels)):
            more = f" and {len(labels) - _MOST_NAMED_FAULTS} more" if len(labels) > _MOST_NAMED_FAULTS else ""
            warnings.warn(
                f"the value changes nothing in {self._idle_count} of "
                f"{counted(self._experiment_count, 'experiment')}: "
                f"{', '.join(labels[:_MOST_NAMED_FAULTS])}{more}",
                MutatorWarning,
                stacklevel=2,
            )


def is_idle(fault: Fault, models: FaultModels) -> bool:
    return all(
        models.get(injection.model).is_neutral(dict(injection.params)) for injection in fault.injections
    )
