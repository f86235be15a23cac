"""Finds the two parallel lines that explain the points of possible marks, by votes and then a fit.

Lines along the road meet at one point of the picture. The car's heading moves it sideways; an error of the
camera's pitch moves it up or down. `drop` px below the known horizon, a line `y` m beside the camera appears
`meeting_left + y * metre * (drop + meeting_dip)` px left of the camera's column.
"""

from collections.abc import Callable
from math import exp
from typing import NamedTuple

import cv2
import numpy as np

from selfdrive.common.array_math import each, natural_log, product
from selfdrive.visiond.band_filter import MarkPoints, mark_points_at
from selfdrive.visiond.road_view import RoadView

VOTE_BIN_WIDTH = 0.1  # m, for votes
MOST_LINE_OFFSET = 4.0  # m, largest lateral position of lines
LEFT_STEP, DIP_STEP = 4.0, 6.0  # px between candidates
CHANCE_POINTS_SHARE = 0.005  # share of a line's rows with points by chance, on the cleanest road
# averages the bins of y around a line
SURROUNDINGS_KERNEL = np.array([[1] * 8 + [0] * 5 + [1] * 8], np.float32) / 16
CHANCE_POINTS_DISTANCE = 0.8  # m from a line, within which points by chance are counted
FIT_ROUND_REACHES = (0.30, 0.20, 0.15, 0.15)  # m from a line, where points are used in each round of the fit
DEPENDENT_POINTS = 10.0  # this many neighbouring points count as one, because they are not independent
FAINT_LINE_SHARE = (
    0.02  # share of rows that makes a line probable if there are no other points; a dash is 0.05
)
POINT_POSITION_ERRORS = 0.5, 0.05  # px and m by which a point can miss its mark


class LanePose(NamedTuple):
    """Two lines: the point where they meet (px), y (m) of each at the camera, and their probabilities: 0 if
    there are no more points than by chance."""

    meeting_left: float
    meeting_dip: float
    y_left: float
    y_right: float
    prob_left: float = 0.0
    prob_right: float = 0.0

    @property
    def middle(self) -> float:
        return 0.5 * (self.y_left + self.y_right)

    @property
    def width(self) -> float:
        return self.y_left - self.y_right


class ExpectedPose(NamedTuple):
    """The expected pose, each value with its standard deviation."""

    middle: tuple[float, float] = (0.0, 0.8)  # m
    width: tuple[float, float] = (3.7, 0.42)  # m
    meeting_left: tuple[float, float] = (0.0, 40.0)  # px
    meeting_dip: tuple[float, float] = (0.0, 6.0)  # px


class VotingPoints:
    """The points: `offset` (px left of the camera's column), `drop` (px below the horizon), `weight` (rows).

    `rows` is the number of the picture's rows that can have points.
    """

    def __init__(self, view: RoadView, points: MarkPoints, rows: float) -> None:
        scale = view.scale[points.row]
        self.offset = view.y[points.column] * scale
        self.drop = view.drop[points.row]
        self.metre = scale / self.drop
        self.weight = points.weight * view.share[points.row]
        self.precision = self.weight / (
            DEPENDENT_POINTS * (POINT_POSITION_ERRORS[0] + POINT_POSITION_ERRORS[1] * scale) ** 2
        )
        self.rows = max(rows, 1.0)


PoseFinder = Callable[[RoadView, np.ndarray, np.ndarray, np.ndarray, ExpectedPose], LanePose]


def find_pose(
    view: RoadView, road: np.ndarray, at: np.ndarray, weight: np.ndarray, belief: ExpectedPose
) -> LanePose:
    """Find the lines from `belief` and points: positions in the map `road`, weights (see `find_crests`)."""
    voters = VotingPoints(view, mark_points_at(at, weight, road), view.rows_with_content(road))
    return fit_pose(elect_candidate(voters, belief), voters, belief)


def elect_candidate(voters: VotingPoints, belief: ExpectedPose) -> LanePose:
    meeting_left = _candidates(*belief.meeting_left, LEFT_STEP)
    meeting_dip = _candidates(*belief.meeting_dip, DIP_STEP)
    meeting_left, meeting_dip = (
        np.repeat(meeting_left, len(meeting_dip)),
        np.tile(meeting_dip, len(meeting_left)),
    )
    votes = _votes(voters, meeting_left, meeting_dip)
    around = cv2.filter2D(votes, -1, SURROUNDINGS_KERNEL, borderType=cv2.BORDER_REFLECT)
    support = natural_log(
        np.float32(1.0) + np.maximum(votes - around, 0.0) / (around + np.float32(CHANCE_POINTS_SHARE))
    )
    support -= (
        0.25
        * (
            _unlikeliness(meeting_left, *belief.meeting_left)
            + _unlikeliness(meeting_dip, *belief.meeting_dip)
        )
    )[:, None]
    y = MOST_LINE_OFFSET - VOTE_BIN_WIDTH * (np.arange(votes.shape[1]) + 0.5)
    best, best_place = -np.inf, (0, 0, 0)
    for width in _candidates(*belief.width, VOTE_BIN_WIDTH):
        lane = round(float(width) / VOTE_BIN_WIDTH)
        pairs = support[:, :-lane] + support[:, lane:]
        middle = 0.5 * (y[:-lane] + y[lane:])
        pairs -= 0.5 * (_unlikeliness(middle, *belief.middle) + _unlikeliness(width, *belief.width))
        at = int(np.argmax(pairs))
        if pairs.flat[at] > best:
            best, best_place = float(pairs.flat[at]), (*divmod(at, pairs.shape[1]), lane)
    which, column, lane = best_place
    return LanePose(
        float(meeting_left[which]), float(meeting_dip[which]), float(y[column]), float(y[column + lane])
    )


def _candidates(mean: float, sigma: float, step: float) -> np.ndarray:
    n = int(2.0 * sigma / step)
    return (mean + step * np.arange(-n, n + 1)).astype(np.float32)


def _unlikeliness(value: np.ndarray, mean: float, sigma: float) -> np.ndarray:
    return (((value - mean) / sigma) ** 2).astype(np.float32)


def _votes(voters: VotingPoints, meeting_left: np.ndarray, meeting_dip: np.ndarray) -> np.ndarray:
    """Share of rows with a point, by candidate and by y; each point is counted in about three bins of y."""
    bins, outside = round(2 * MOST_LINE_OFFSET / VOTE_BIN_WIDTH), 1
    y = (voters.offset - meeting_left[:, None]) / (voters.metre * (voters.drop + meeting_dip[:, None]))
    column = ((MOST_LINE_OFFSET - y) * np.float32(1.0 / VOTE_BIN_WIDTH) + outside).astype(np.int32)
    np.clip(column, 0, bins + outside, out=column)
    column += (np.arange(len(meeting_left), dtype=np.int32) * (bins + 2 * outside))[:, None]
    votes = np.bincount(
        column.ravel(),
        weights=np.broadcast_to(voters.weight, column.shape).ravel(),
        minlength=len(meeting_left) * (bins + 2 * outside),
    )
    votes = votes.reshape(len(meeting_left), -1)[:, outside:-outside].astype(np.float32) / voters.rows
    return cv2.filter2D(votes, -1, np.float32([[0.5, 1.0, 0.5]]), borderType=cv2.BORDER_CONSTANT)


class FitResult(NamedTuple):
    """The result of the fit, `state` (4), and the values of its last step before the state moved.

    `pixels_per_metre` is by point (n); `pixel_errors` and `counted_weights` are by line and point (2, n).
    """

    state: np.ndarray
    pixels_per_metre: np.ndarray
    pixel_errors: np.ndarray
    counted_weights: np.ndarray


def fit_state(
    state: np.ndarray, voters: VotingPoints, expected: np.ndarray, believed: np.ndarray
) -> FitResult:
    """Move `state` (the first four values of a LanePose) by weighted Gauss-Newton steps.

    Points further from a line have less weight. `expected` (4, 4) times the state should be `believed`.
    """
    n = len(voters.offset)
    terms = np.zeros((5, 2, n))  # negative derivatives of the error for each unknown, and the error
    terms[0] = 1.0
    prior = product(expected.T, expected)
    for near in FIT_ROUND_REACHES:
        metre = voters.metre * (voters.drop + state[1])
        y = state[2:, None]
        error = voters.offset - state[0] - y * metre
        count = np.maximum(1.0 - (error / (metre * near)) ** 2, 0.0)
        terms[1] = y * voters.metre
        terms[2, 0] = terms[3, 1] = metre
        terms[4] = error
        design = terms.reshape(5, 2 * n)
        sums = product(design, (design[:4] * (count * voters.precision).reshape(-1)).T)
        surprise = believed - (expected * state).sum(axis=1)
        pull = sums[4] + (expected.T * surprise).sum(axis=1)
        state = state + _solve(sums[:4] + prior, pull)
    return FitResult(state, metre, error, count)


def fit_pose(pose: LanePose, voters: VotingPoints, belief: ExpectedPose) -> LanePose:
    """Fit `pose` to the points around its lines; `belief` determines what the points do not."""
    means, sigmas = np.array([belief.meeting_left, belief.meeting_dip, belief.middle, belief.width]).T
    expected = np.array([(1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 0.5, 0.5), (0, 0, 1, -1)]) / sigmas[:, None]
    state, metre, error, count = fit_state(np.array(pose[:4]), voters, expected, means / sigmas)
    near = FIT_ROUND_REACHES[-1]
    off = np.abs(error / metre)
    beside = (((off > near) & (off < CHANCE_POINTS_DISTANCE)) * voters.weight).sum(axis=1) / voters.rows
    chance = beside * (4.0 / 3.0 * near / (2.0 * (CHANCE_POINTS_DISTANCE - near)))
    excess = np.maximum((count * voters.weight).sum(axis=1) / voters.rows - chance, 0.0)
    prob = 1.0 - each(exp, -excess / (FAINT_LINE_SHARE + chance))
    return LanePose(*state.tolist(), *prob.tolist())


def _solve(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Solve matrix * x = right for a positive definite matrix, by elimination."""
    rows = np.column_stack((matrix, right)).tolist()
    for i, pivot in enumerate(rows):
        for row in rows[:i] + rows[i + 1 :]:
            factor = row[i] / pivot[i]
            row[:] = [x - factor * y for x, y in zip(row, pivot, strict=True)]
    return np.array([row[-1] / row[i] for i, row in enumerate(rows)])
