"""The interface of lane detectors, and the ideal one."""

from typing import NamedTuple, Protocol

from selfdrive.messages import VIEW_LENGTH, CameraView

LANE_WIDTH = 3.7  # m


class RoadLine(NamedTuple):
    """A line ahead of the car: `y` (m, left positive) at the car, then y + slope * x + bend[x].

    If the line was not seen, `prob` is 0, and `y` and `slope` are the expected ones.
    """

    y: float
    slope: float = 0.0
    prob: float = 1.0
    bend: tuple[float, ...] | None = None  # m at 0, 1, ... 49 m; None: straight


class LaneLines(NamedTuple):
    left: RoadLine
    right: RoadLine
    path: RoadLine


class LaneDetector(Protocol):
    """Finds the lane's lines in the camera's view, at 20 Hz."""

    def detect(self, view: CameraView) -> LaneLines:
        """Return the lines in this view. They must not depend on other runs."""
        ...


class IdealDetector:
    def detect(self, view: CameraView) -> LaneLines:
        return LaneLines(
            left=RoadLine(y=view.left_lane_y, bend=view.bend),
            right=RoadLine(y=view.right_lane_y, bend=view.bend),
            path=RoadLine(y=view.path_y, bend=view.bend),
        )


class MirroredDetector:
    def __init__(self, detector: LaneDetector) -> None:
        self._detector = detector

    def detect(self, view: CameraView) -> LaneLines:
        return LaneLines(*(_mirror_line(line) for line in self._detector.detect(view)))


def _mirror_line(line: RoadLine) -> RoadLine:
    bend = line.bend and tuple(-y for y in line.bend)
    return RoadLine(y=-line.y, slope=-line.slope, prob=line.prob, bend=bend)


def path_between(left: RoadLine, right: RoadLine, width: float = LANE_WIDTH) -> RoadLine:
    """The lane centre: between two lines, or half a `width` (m) from a single one, or straight ahead."""
    detected = [line for line in (left, right) if line.prob > 0.0]
    if len(detected) == 2:
        return RoadLine(
            y=0.5 * (left.y + right.y),
            slope=0.5 * (left.slope + right.slope),
            prob=left.prob * right.prob,
        )
    if not detected:
        return RoadLine(y=0.0, prob=0.0)
    (line,) = detected
    return RoadLine(
        y=line.y + (0.5 if line is right else -0.5) * width, slope=line.slope, prob=0.5 * line.prob
    )


def message_points(y: float, line: RoadLine) -> tuple[float, ...]:
    """A message's 50 points (m, 1 m apart) of `line`, which passes the car at `y`."""
    if line.bend is not None:
        return tuple([y + bend for bend in line.bend])
    slope = line.slope
    return tuple([y + slope * x for x in range(VIEW_LENGTH)])
