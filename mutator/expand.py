"""From spec to faults: values drawn, units converted, parameters checked against their model."""

from mutator.fault_models import FaultModels
from mutator.manifest import TargetManifest
from mutator.model import Fault
from mutator.spec import AS_DESCRIBED, FaultSpec


def expand(
    spec: FaultSpec,
    seed: int,
    reading: str = AS_DESCRIBED,
    *,
    models: FaultModels,
    manifest: TargetManifest,
) -> tuple[Fault, ...]:
    """The faults of `spec`, in the order of its variants and ranges.

    The same seed gives the same values in both readings and whatever the triggers, scenarios and methods are.
    MutatorError (file:line) for an unknown model or parameter, a wrong unit, a value out of range, a location
    outside the target or in a forbidden place, a change the target does not offer. Anchors are resolved when
    a mutant is built.
    """
    raise NotImplementedError
