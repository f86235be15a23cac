"""Warns about experiments whose fault changes nothing."""

import warnings
from collections.abc import Sequence

from mutator._common.message_text import counted
from mutator.errors import MutatorWarning
from mutator.faults.fault_models import FaultModels
from mutator.model import Experiment, Fault

_MOST_NAMED_FAULTS = 3  # how many faults a warning names


class NeutralFaultWarner:
    """Collects the faults whose value changes nothing, and counts their experiments."""

    def __init__(self, models: FaultModels) -> None:
        self._models = models
        self._neutral_labels: list[str] = []
        self._neutral_experiment_count = self._experiment_count = 0

    def add(self, experiments: Sequence[Experiment]) -> None:
        faults = {experiment.fault.id: experiment.fault for experiment in experiments}
        neutral_faults = {
            name: fault for name, fault in faults.items() if is_neutral_fault(fault, self._models)
        }
        self._neutral_labels += [fault.label for fault in neutral_faults.values()]
        self._neutral_experiment_count += (
            sum(experiment.fault.id in neutral_faults for experiment in experiments) if neutral_faults else 0
        )
        self._experiment_count += len(experiments)

    def warn(self) -> None:
        if labels := list(dict.fromkeys(self._neutral_labels)):
            more = f" and {len(labels) - _MOST_NAMED_FAULTS} more" if len(labels) > _MOST_NAMED_FAULTS else ""
            warnings.warn(
                f"the value changes nothing in {self._neutral_experiment_count} of "
                f"{counted(self._experiment_count, 'experiment')}: "
                f"{', '.join(labels[:_MOST_NAMED_FAULTS])}{more}",
                MutatorWarning,
                stacklevel=2,
            )


def is_neutral_fault(fault: Fault, models: FaultModels) -> bool:
    return all(
        models.get(injection.model).is_neutral(dict(injection.params)) for injection in fault.injections
    )
