"""Planes as users ask for them: the magnitudes of a variant, and durations."""

from collections.abc import Iterator

from mutator.explore.lattice import magnitudes_between
from mutator.faults.fault_specs import Variant

_SMALLEST_SHARE = 0.01  # of the largest magnitude of a variant


def magnitudes_by_sign(variant: Variant, points: int) -> Iterator[list[float]]:
    """Yield the magnitudes of a variant, by size: its positive ones, then its negative ones.

    A variant that lists its values has these. Others have `points` values at equal distances of their
    logarithm, up to the largest one that the spec declares. Without any value: one empty list.
    """
    if variant.draw is None:
        yield []
        return
    low, high = variant.draw.least_and_greatest
    for largest, sign in ((high, 1), (-low, -1)):
        if largest <= 0:
            continue
        if variant.draw.kind == "list":
            yield sorted((value for value in variant.draw.values if value * sign > 0), key=abs)
        else:
            yield [sign * value for value in magnitudes_between(largest * _SMALLEST_SHARE, largest, points)]
