"""The predicted path, from which the lateral distance of radar tracks is measured."""

from collections.abc import Callable
from math import asin, copysign, hypot, tan

from selfdrive.common.interp import clip
from selfdrive.controls.lib.polynomial import Poly, slope, value

REACH = 140.0  # m; no path is known further ahead
NEAREST_STEPS = 3  # few, because paths bend little

Curve = Callable[[float], tuple[float, float]]  # x in m to y and dy/dx


def model_curve(poly: Poly) -> Curve:
    return lambda x: (value(poly, x), slope(poly, x))


def steering_curve(curvature: float) -> Curve:
    """The circle of this curvature (1/m), which the car follows at the current steering angle."""

    def curve(x: float) -> tuple[float, float]:
        # limited to the circle's extent
        angle = asin(clip(x * curvature, -0.999, 0.999))
        return x * tan(angle / 2.0), tan(angle)

    return curve


def distance_to(curve: Curve, x: float, y: float) -> float:
    """Return the distance in m of the point (x, y) from the curve, positive on its left.

    Gauss-Newton steps from abeam find the nearest point; on a straight line the first step is exact.
    """
    y_abeam, steep = curve(clip(x, 0.0, REACH))
    near, y_near = clip(x, 0.0, REACH), y_abeam
    for _ in range(NEAREST_STEPS):
        step = ((x - near) + (y - y_near) * steep) / (1.0 + steep * steep)
        if not abs(step) > 1e-6:
            break
        near = clip(near + step, 0.0, REACH)
        y_near, steep = curve(near)
    gap = hypot(near - x, y_near - y)
    return 0.0 if y == y_abeam else copysign(gap, y - y_abeam)
