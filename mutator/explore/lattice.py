"""The lattice of an exploration: magnitudes and durations at equal distances of their logarithm."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TypeAlias

_SIGNIFICANT_DIGITS = 3  # of a magnitude: enough to tell neighbours apart, and numbers that people read

Cell: TypeAlias = tuple[int, int]  # number of the magnitude, number of the duration


@dataclass(frozen=True, slots=True, kw_only=True)
class Lattice:
    """Magnitudes in the fault's unit and durations in s, both ascending. A cell is one of each.

    A fault without a value has one magnitude, None.
    """

    magnitudes: tuple[float | None, ...]
    durations_s: tuple[float, ...]

    @property
    def size(self) -> int:
        """The number of cells."""
        return len(self.magnitudes) * len(self.durations_s)

    @property
    def largest(self) -> Cell:
        """The cell of the largest and longest fault."""
        return len(self.magnitudes) - 1, len(self.durations_s) - 1


def magnitudes_between(first: float, last: float, points: int) -> tuple[float, ...]:
    """Return at most `points` magnitudes from `first` to `last`, rounded to three digits but for the ends."""
    first, last = (float(f"{end:.12g}") for end in (first, last))  # 2.5, not 2.5000000000000004
    rounded = (_rounded(value) for value in _logarithmic_steps(first, last, points))
    return tuple(sorted({first, last, *(value for value in rounded if first < value < last)}))


def durations_between(first_s: float, last_s: float, points: int, step_s: float) -> tuple[float, ...]:
    """Return at most `points` durations in s, each a whole number of steps of the target."""
    counts = {round(value / step_s) for value in _logarithmic_steps(first_s, last_s, points)}
    return tuple(round(count * step_s, 9) for count in sorted(counts) if count >= 1)


def _logarithmic_steps(first: float, last: float, points: int) -> list[float]:
    if points < 2 or first >= last:
        return [last]
    return [first * (last / first) ** (i / (points - 1)) for i in range(points)]


def _rounded(value: float) -> float:
    return round(value, _SIGNIFICANT_DIGITS - 1 - math.floor(math.log10(value)))


def cell_edges(values: Sequence[float]) -> list[float]:
    """Return the edges of cells on a logarithmic axis: between neighbours, and as far beyond the ends."""
    sizes = [abs(value) for value in values]
    inner = [math.sqrt(a * b) for a, b in pairwise(sizes)]
    if not inner:
        return [sizes[0] / 2, sizes[0] * 2]
    return [sizes[0] ** 2 / inner[0], *inner, sizes[-1] ** 2 / inner[-1]]
