"""The road: grade over time, curvature over distance."""

from collections.abc import Sequence

from selfdrive.common.interp import interp

PiecewiseTable = tuple[Sequence[float], Sequence[float]]


class Road:
    """Grade (m/s^2, uphill positive) as a table over time, curvature (1/m, left positive) over distance."""

    def __init__(self, grade: PiecewiseTable | None, curvature: PiecewiseTable | None) -> None:
        self._grade, self._curvature = grade, curvature

    def grade(self, t: float) -> float:
        """Deceleration due to the slope at time `t` (s)."""
        return interp(t, *self._grade) if self._grade else 0.0

    def curvature(self, position: float) -> float:
        return interp(position, *self._curvature) if self._curvature else 0.0

    def bend(self, position: float, length: int) -> tuple[float, ...] | None:
        """Lateral distance from the tangent at 0, 1, ... `length` - 1 m ahead; None if straight."""
        if self._curvature is None:
            return None
        sideways, direction, points = 0.0, 0.0, []
        for x in range(length):
            points.append(sideways)
            turn = self.curvature(position + x + 0.5)
            sideways += direction + 0.5 * turn
            direction += turn
        return tuple(points)

    def sideways(self, position: float, distance: float) -> float:
        """Lateral distance (m) from the tangent `distance` m ahead, to the nearest metre."""
        points = self.bend(position, max(round(distance), 0) + 1)
        return points[-1] if points else 0.0
