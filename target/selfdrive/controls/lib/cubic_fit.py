"""Cubics fitted to points one metre apart."""

from collections.abc import Sequence
from fractions import Fraction
from functools import cache
from math import lcm
from operator import mul

from selfdrive.common.ordered import total
from selfdrive.controls.lib.polynomial import Poly

POWERS = (3, 2, 1, 0)
N_POINTS = 50


class CubicFit:
    """Least squares on points at 0, 1, ... 49 m."""

    def __call__(self, points: Sequence[float]) -> Poly:
        """The cubic through `points` (m)."""
        a, b, c, d = weights(N_POINTS)
        return (
            total(map(mul, a, points)),
            total(map(mul, b, points)),
            total(map(mul, c, points)),
            total(map(mul, d, points)),
        )


@cache
def weights(n: int) -> tuple[tuple[float, ...], ...]:
    """What each of `n` points has to do with each coefficient: worked out exactly, so that it is the same on
    every machine."""
    normal = [[total(x ** (i + j) for x in range(n)) for j in POWERS] for i in POWERS]
    found = []
    for row in _inverse(normal):
        divisor = lcm(*(share.denominator for share in row))
        a, b, c, d = (int(share * divisor) for share in row)
        found.append(tuple((((a * x + b) * x + c) * x + d) / divisor for x in range(n)))
    return tuple(found)


def _inverse(matrix: list[list[int]]) -> list[list[Fraction]]:
    """Inverse of a positive definite matrix, by elimination, exact."""
    n = len(matrix)
    rows = [[Fraction(x) for x in row] + [Fraction(i == j) for j in range(n)] for i, row in enumerate(matrix)]
    for i in range(n):
        pivot = rows[i][i]
        rows[i] = [x / pivot for x in rows[i]]
        for j in range(n):
            if j != i:
                factor = rows[j][i]
                rows[j] = [x - factor * y for x, y in zip(rows[j], rows[i], strict=True)]
    return [row[n:] for row in rows]
