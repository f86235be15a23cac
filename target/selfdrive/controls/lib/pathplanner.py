"""The road ahead: lane lines, the model's path, and the path to follow."""

from selfdrive.common.interp import interp
from selfdrive.controls.lib.compiled_fit import build_fit
from selfdrive.controls.lib.lateral_mpc import Lanes
from selfdrive.controls.lib.polynomial import ZERO, Poly, blend, shifted
from selfdrive.messages import ModelData

WIDTH_RATE = 0.005  # weight of a new width in the estimate, per model message
CERTAINTY_RATE = 0.05
USUAL_WIDTH = ((0.0, 31.0), (3.0, 3.8))  # m over m/s: roads for higher speeds are wider
WIDTH_DOUBT = ((0.3, 1.0), (1.0, 0.0))  # trust in the right line over the error of the width in m
PATH_PROB = 1.0  # the model does not report the probability of its path
MIN_LANE_PROB = 0.01  # of both lines together; below it, only the model's path counts


class ModelFit:
    """Fits cubics to the three lines of a model message.

    radard and plannerd both fit each message, and fitting is slow, so the last result is cached.
    """

    def __init__(self) -> None:
        self._fit = build_fit()
        self._model: ModelData | None = None
        self._polys = (ZERO, ZERO, ZERO)

    def polys(self, model: ModelData) -> tuple[Poly, Poly, Poly]:
        """Left line, right line, path."""
        if model is not self._model:
            self._model = model
            lines = (model.left_lane, model.right_lane, model.path)
            left, right, path = (self._fit(line.points) for line in lines)
            self._polys = (left, right, path)
        return self._polys


class PathPlanner:
    def __init__(self, fit: ModelFit) -> None:
        self.lanes = Lanes(ZERO, ZERO, ZERO, 0.0, 0.0, 3.7)
        self.d_poly = ZERO  # path to follow
        self.c_poly = ZERO  # middle of the lane
        self.c_prob = 0.0
        self._fit = fit
        self._width_estimate = 3.7  # m
        self._width_certainty = 1.0

    @property
    def lane_width(self) -> float:
        return self.lanes.lane_width

    def update(self, v_ego: float, model: ModelData) -> None:
        left, right, path = self._fit.polys(model)
        left_prob = model.left_lane.prob
        width_seen = abs(left[3] - right[3])
        width = self._update_width(v_ego, width_seen, left_prob * model.right_lane.prob)
        right_prob = model.right_lane.prob * interp(abs(width - width_seen), *WIDTH_DOUBT)
        self.lanes = Lanes(left, right, path, left_prob, right_prob, width)
        self._choose_path()

    def _update_width(self, v_ego: float, seen: float, both_prob: float) -> float:
        self._width_certainty += CERTAINTY_RATE * (both_prob - self._width_certainty)
        self._width_estimate += WIDTH_RATE * (seen - self._width_estimate)
        doubt = 1.0 - self._width_certainty
        return self._width_certainty * self._width_estimate + doubt * interp(v_ego, *USUAL_WIDTH)

    def _choose_path(self) -> None:
        lanes = self.lanes
        left_prob, right_prob = lanes.left_prob, lanes.right_prob
        if left_prob + right_prob > MIN_LANE_PROB:
            half = lanes.lane_width / 2.0
            from_left, from_right = shifted(lanes.left_poly, -half), shifted(lanes.right_poly, half)
            self.c_poly = blend(from_left, left_prob, from_right, right_prob)
            self.c_prob = left_prob + right_prob - left_prob * right_prob
        else:
            self.c_poly = ZERO
            self.c_prob = 0.0
        self.d_poly = blend(self.c_poly, self.c_prob, lanes.path_poly, PATH_PROB)
