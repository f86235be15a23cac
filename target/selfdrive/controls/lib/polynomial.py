"""Cubics y(x), coefficients highest power first."""

Poly = tuple[float, float, float, float]

ZERO: Poly = (0.0, 0.0, 0.0, 0.0)


def value(poly: Poly, x: float) -> float:
    a, b, c, d = poly
    return ((a * x + b) * x + c) * x + d


def slope(poly: Poly, x: float) -> float:
    a, b, c, _ = poly
    return (3.0 * a * x + 2.0 * b) * x + c


def shifted(poly: Poly, dy: float) -> Poly:
    """Return the curve moved to the left by `dy`."""
    a, b, c, d = poly
    return a, b, c, d + dy


def blend(first: Poly, weight1: float, second: Poly, weight2: float) -> Poly:
    """Return the weighted mean of two curves; zero if both weights are zero."""
    total = weight1 + weight2
    if total <= 0.0:
        return ZERO
    w1, w2 = weight1 / total, weight2 / total
    a1, b1, c1, d1 = first
    a2, b2, c2, d2 = second
    return a1 * w1 + a2 * w2, b1 * w1 + b2 * w2, c1 * w1 + c2 * w2, d1 * w1 + d2 * w2
