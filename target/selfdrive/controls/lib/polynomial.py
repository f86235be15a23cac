"""Cubics y(x), coefficients highest power first, fitted to points one metre apart."""

from collections.abc import Sequence
from fractions import Fraction
from operator import mul

from selfdrive.common.ordered import total

Poly = tuple[float, float, float, float]

ZERO: Poly = (0.0, 0.0, 0.0, 0.0)
POWERS = (3, 2, 1, 0)


class CubicFit:
    """Least squares on `n` points at 0, 1, ... n - 1 m.

    The weights of the points are worked out once, exactly, so that they are the same on every machine.
    """

    def __init__(self, n: int = 50) -> None:
        normal = [[total(x ** (i + j) for x in range(n)) for j in POWERS] for i in POWERS]
        self._weights = tuple(
            tuple(float(total(c * x**p for c, p in zip(row, POWERS, strict=True))) for x in range(n))
            for row in _inverse(normal)
        )

    def __call__(self, points: Sequence[float]) -> Poly:
        """The cubic through `points` (m)."""
        a, b, c, d = self._weights
        return (
            total(map(mul, a, points)),
            total(map(mul, b, points)),
            total(map(mul, c, points)),
            total(map(mul, d, points)),
        )


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


def value(poly: Poly, x: float) -> float:
    """y at x."""
    a, b, c, d = poly
    return ((a * x + b) * x + c) * x + d


def slope(poly: Poly, x: float) -> float:
    """dy/dx at x."""
    a, b, c, _ = poly
    return (3.0 * a * x + 2.0 * b) * x + c


def shifted(poly: Poly, dy: float) -> Poly:
    """The curve moved by `dy` to the left."""
    a, b, c, d = poly
    return a, b, c, d + dy


def blend(first: Poly, weight1: float, second: Poly, weight2: float) -> Poly:
    """Weighted mean of two curves; zero when neither has weight."""
    total = weight1 + weight2
    if total <= 0.0:
        return ZERO
    w1, w2 = weight1 / total, weight2 / total
    a1, b1, c1, d1 = first
    a2, b2, c2, d2 = second
    return a1 * w1 + a2 * w2, b1 * w1 + b2 * w2, c1 * w1 + c2 * w2, d1 * w1 + d2 * w2
