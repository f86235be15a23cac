"""Planes as users ask for them: the magnitudes of a variant, and durations."""

from collections.abc import Iterator, Set
from dataclasses import replace

from mutator.explore.challengers import CHALLENGED_MODEL, SIZE_PARAM
from mutator.explore.lattice import magnitudes_between
from mutator.faults.fault_models import FaultModels
from mutator.faults.fault_specs import Variant
from mutator.faults.injection_specs import InjectionSpec
from mutator.model import Fault
from mutator.targets.manifest import TargetManifest

_SMALLEST_SHARE = 0.01  # of the largest magnitude of a variant


def magnitudes_by_sign(variant: Variant, points: int) -> Iterator[list[float]]:
    """Yield the magnitudes of a variant, by size: its positive ones, then its negative ones.

    A variant that lists its values has these. Others have `points` values at equal distances of their
    logarithm, up to the largest one that the spec declares. Without any value: one empty list. ValueError for
    a listed 0, which is no size.
    """
    if variant.draw is None:
        yield []
        return
    if variant.draw.kind == "list":
        yield from _listed_by_sign(set(variant.draw.values))
        return
    low, high = variant.draw.least_and_greatest
    for largest, sign in ((high, 1), (-low, -1)):
        if largest > 0:
            yield [sign * value for value in magnitudes_between(largest * _SMALLEST_SHARE, largest, points)]


def can_be_challenged(variant: Variant, reading: str) -> bool:
    """Whether all that a variant injects is a constant error whose size, with its sign, is the value."""
    if variant.draw is None or variant.paired_draws:
        return False
    return all(
        injection.model == CHALLENGED_MODEL and _has_drawn_size(injection)
        for injection in variant.injections_in_reading(reading)
    )


def has_random_numbers(variant: Variant, reading: str, models: FaultModels) -> bool:
    """Whether what a variant injects depends on a seed."""
    injections = variant.injections_in_reading(reading)
    return any(param.type == "seed" for i in injections for param in models.get(i.model).params)


def explored_fault(fault: Fault, manifest: TargetManifest) -> Fault:
    """Return the fault as it is explored. How long it lasts is the plane's, whatever its spec declares; so is
    the traffic: changes with which scenarios are the same are left out.
    """
    changes = (name for name in fault.changes if not manifest.same_scenarios_by_change.get(name))
    return replace(fault, hold=None, changes=tuple(changes))


def _has_drawn_size(injection: InjectionSpec) -> bool:
    return any(p.name == SIZE_PARAM and not isinstance(p.value, int | float) for p in injection.params)


def _listed_by_sign(values: Set[float]) -> Iterator[list[float]]:
    for sign in (1, -1):
        if sizes := sorted((value for value in values if value * sign > 0), key=abs):
            yield sizes
    if 0 in values:
        raise ValueError("0 among the listed values")
