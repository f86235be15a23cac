"""What a plan warns of: experiments that can show nothing."""

import warnings
from collections.abc import Sequence

from mutator._common.text import counted
from mutator.errors import MutatorWarning
from mutator.faults.fault_models import FaultModels
from mutator.model import Experiment, Fault

_NAMED = 3  # faults that a warning names


def warn_of_values(experiments: Sequence[Experiment], models: FaultModels) -> None:
    """A MutatorWarning for faults whose value changes nothing, with how many experiments have one."""
    faults = {experiment.fault.id: experiment.fault for experiment in experiments}
    idle = {name: fault for name, fault in faults.items() if changes_nothing(fault, models)}
    if idle:
        count = sum(experiment.fault.id in idle for experiment in experiments)
        labels = [fault.label for fault in idle.values()]
        more = f" and {len(labels) - _NAMED} more" if len(labels) > _NAMED else ""
        warnings.warn(
            f"the value of {count} of {counted(len(experiments), 'experiment')} changes nothing: "
            f"{', '.join(labels[:_NAMED])}{more}",
            MutatorWarning,
            stacklevel=2,
        )


def changes_nothing(fault: Fault, models: FaultModels) -> bool:
    """Whether a fault leaves everything as it is, with the value that it has."""
    return all(models.get(one.model).changes_nothing(dict(one.params)) for one in fault.injections)
