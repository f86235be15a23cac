"""Cubics fitted to points one metre apart."""

from collections.abc import Sequence
from functools import cache
from operator import mul

from selfdrive.common.ordered import total
from selfdrive.controls.lib.polynomial import Poly

POWERS = (3, 2, 1, 0)
N_POINTS = 50


class CubicFit:
    """Least squares on points at 0, 1, ... 49 m."""

    def __call__(self, points: Sequence[float]) -> Poly:
        a, b, c, d = weights(N_POINTS)
        return (
            total(map(mul, a, points)),
            total(map(mul, b, points)),
            total(map(mul, c, points)),
            total(map(mul, d, points)),
        )


@cache
def weights(n: int) -> tuple[tuple[float, ...], ...]:
    """Weights of `n` points in each coefficient; exact, so that they are the same on every machine."""
    normal = [[total(x ** (i + j) for x in range(n)) for j in POWERS] for i in POWERS]
    return tuple(
        tuple((((a * x + b) * x + c) * x + d) / divisor for x in range(n))
        for (a, b, c, d), divisor in _inverse(normal)
    )


def _inverse(matrix: list[list[int]]) -> list[tuple[list[int], int]]:
    """Exact inverse of a positive definite matrix: rows of integers, and the divisor of each row."""
    n = len(matrix)
    rows = [row + [int(i == j) for j in range(n)] for i, row in enumerate(matrix)]
    before = 1  # the last pivot, which divides all elements (E. H. Bareiss, Math. Comp. 22, 1968)
    for i in range(n):
        pivot = rows[i][i]
        for j in range(n):
            if j != i:
                factor = rows[j][i]
                rows[j] = [(pivot * x - factor * y) // before for x, y in zip(rows[j], rows[i], strict=True)]
        before = pivot
    return [(row[n:], row[i]) for i, row in enumerate(rows)]
