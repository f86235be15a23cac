"""The geometric lane detector: bands as wide as marks, votes for two parallel lines, and a memory.

It searches near its last result, so rain, snow or dirt hardly matter. A missing line is placed relative to
the other one; if both are missing, their positions are kept for a while.
"""

from selfdrive.common.camera_model import CameraModel
from selfdrive.messages import CameraView
from selfdrive.visiond.band_filter import CrestFinder, find_crests, strongest_points
from selfdrive.visiond.detector import LANE_WIDTH, LaneLines, RoadLine, path_between
from selfdrive.visiond.road_view import RoadView
from selfdrive.visiond.voting import ExpectedPose, LanePose, PoseFinder, find_pose

MIN_SEEN_PROBABILITY = 0.5  # probability above which a found line is used
FADING_FACTOR = 0.92  # factor on the probability of an unseen line per picture
MOST_PICTURES_WITHOUT_LINES = 20  # pictures without any line after which the position is unknown
MIN_PROBABILITY = 0.01  # less probable lines are dropped
MIDDLE_SIGMA, LEFT_RATE = (0.10, 0.03), 0.012  # m and m per picture; rad: possible motion of the car
WIDTH_SIGMA, DIP_SIGMA = 0.02, 1.5  # m, px: possible changes of lane width and pitch
LANE_CHANGE_MARGIN = 0.3  # m past a line, where the car is in the next lane


class RobustDetector:
    """Finds the lines in one run's pictures from one camera, and remembers its last result.

    `calculated_by` identifies the compiled code of `view`, `find` and `choose`, if any.
    """

    def __init__(
        self,
        model: CameraModel,
        view: RoadView | None = None,
        find: CrestFinder = find_crests,
        choose: PoseFinder = find_pose,
        calculated_by: str = "",
    ) -> None:
        self._find, self._choose, self.calculated_by = find, choose, calculated_by
        self._model = model
        self._view = view or RoadView(model)
        self._pose: LanePose | None = None
        self._pictures_without_lines = 0  # pictures since a line was seen
        self._probs = (0.0, 0.0)

    @property
    def state(self) -> tuple[float, ...]:
        """The complete memory, as numbers that can be restored."""
        return (self._pictures_without_lines, *self._probs, *(self._pose or ()))

    @state.setter
    def state(self, numbers: tuple[float, ...]) -> None:
        missed, left, right, *pose = numbers
        self._pictures_without_lines, self._probs = int(missed), (left, right)
        self._pose = LanePose(*pose) if pose else None

    def detect(self, view: CameraView) -> LaneLines:
        road = self._view.map_picture(view.picture)
        points = strongest_points(*self._find(road))
        self._remember(self._choose(self._view, road, *points, self._belief()))
        return self._lines()

    def _belief(self) -> ExpectedPose:
        pose = self._pose
        if pose is None:
            return ExpectedPose()
        return ExpectedPose(
            middle=(pose.middle, MIDDLE_SIGMA[0] + MIDDLE_SIGMA[1] * self._pictures_without_lines),
            width=(pose.width, WIDTH_SIGMA),
            meeting_left=(
                pose.meeting_left,
                LEFT_RATE * self._model.fx * (1.0 + 0.5 * self._pictures_without_lines),
            ),
            meeting_dip=(pose.meeting_dip, DIP_SIGMA),
        )

    def _remember(self, pose: LanePose) -> None:
        probabilities = (pose.prob_left, pose.prob_right)
        if max(probabilities) > MIN_SEEN_PROBABILITY or self._pose is None:
            self._pose, self._pictures_without_lines = pose, 0
        else:
            self._pictures_without_lines += 1
        probs = [
            max(now, FADING_FACTOR * before) for now, before in zip(probabilities, self._probs, strict=True)
        ]
        self._probs = tuple(prob if prob > MIN_PROBABILITY else 0.0 for prob in probs)
        if self._pictures_without_lines > MOST_PICTURES_WITHOUT_LINES or self._probs == (0.0, 0.0):
            self._pose = None
        elif abs(self._pose.middle) > 0.5 * self._pose.width + LANE_CHANGE_MARGIN:
            self._change_lane()

    def _change_lane(self) -> None:
        lane = self._pose.width if self._pose.middle < 0.0 else -self._pose.width
        self._pose = self._pose._replace(y_left=self._pose.y_left + lane, y_right=self._pose.y_right + lane)

    def _lines(self) -> LaneLines:
        if self._pose is None:
            left, right = (RoadLine(y=side * 0.5 * LANE_WIDTH, prob=0.0) for side in (1.0, -1.0))
            return LaneLines(left=left, right=right, path=path_between(left, right))
        left = self._line_at(self._pose.y_left, self._probs[0])
        right = self._line_at(self._pose.y_right, self._probs[1])
        return LaneLines(left=left, right=right, path=path_between(left, right, self._pose.width))

    def _line_at(self, y: float, prob: float) -> RoadLine:
        model, pose = self._model, self._pose
        a = -y * model.lines_divergence(1.0)
        b = model.cx - pose.meeting_left - a * (model.horizon - pose.meeting_dip)
        at_camera, slope = model.line_on_road(a, b)
        return RoadLine(y=at_camera, slope=slope, prob=prob)
