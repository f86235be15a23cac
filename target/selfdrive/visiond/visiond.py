"""visiond: from the camera's view to the road model, 20 times a second."""

from selfdrive.messages import CameraView, LeadVision, ModelData, PathData

LINE_STD = 1.0  # m
LEAD_STD = 0.1  # m


class Visiond:
    """Ideal vision: the geometry in view, with full confidence.

    `latest` is the newest published ModelData, None before the first; its `t` tells its age.
    """

    def __init__(self) -> None:
        self.latest: ModelData | None = None

    def update(self, view: CameraView, t: float) -> None:
        """Form a road model of the view taken at time `t` (s) and publish it."""
        left_lane_y = view.left_lane_y
        right_lane_y = view.right_lane_y
        path_y = view.path_y
        lead_d_rel = view.lead_d_rel
        model = ModelData(
            t=t,
            path=_line(path_y, view.bend),
            left_lane=_line(left_lane_y, view.bend),
            right_lane=_line(right_lane_y, view.bend),
            lead=LeadVision(d_rel=lead_d_rel, prob=1.0, std=LEAD_STD),
        )
        self.publish(model)

    def publish(self, model: ModelData) -> None:
        """Make the model visible to the rest of the controller."""
        self.latest = model


def _line(y: float, bend: tuple[float, ...]) -> PathData:
    """A line that passes the car at `y` (m, left positive) and bends with the road."""
    return PathData(points=tuple([y + b for b in bend]), prob=1.0, std=LINE_STD)
