"""visiond: from the camera's view to the road model, at 20 Hz."""

from selfdrive.messages import CameraView, LeadVision, ModelData, PathData
from selfdrive.visiond.detector import LaneDetector, RoadLine, message_points

LINE_STD = 1.0  # m
LEAD_STD = 0.1  # m


class Visiond:
    """Runs a detector on each view and publishes the result.

    `latest` is the newest ModelData, None before the first; its `t` gives its age.
    """

    def __init__(self, detector: LaneDetector) -> None:
        self._detector = detector
        self.latest: ModelData | None = None

    def update(self, view: CameraView, t: float) -> None:
        """Compute and publish a road model of the view taken at time `t` (s)."""
        lines = self._detector.detect(view)
        left_lane_y = lines.left.y
        right_lane_y = lines.right.y
        path_y = lines.path.y
        lead_d_rel = view.lead_d_rel
        model = ModelData(
            t=t,
            path=_line(path_y, lines.path),
            left_lane=_line(left_lane_y, lines.left),
            right_lane=_line(right_lane_y, lines.right),
            lead=LeadVision(d_rel=lead_d_rel, prob=1.0, std=LEAD_STD),
        )
        self.publish(model)

    def publish(self, model: ModelData) -> None:
        """Make the model visible to the rest of the controller."""
        self.latest = model


def _line(y: float, line: RoadLine) -> PathData:
    """The message for a line that passes the car at `y` (m, left positive)."""
    return PathData(points=message_points(y, line), valid=line.prob > 0.0, prob=line.prob, std=LINE_STD)
