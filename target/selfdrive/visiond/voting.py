"""Finds the two parallel lines that explain the points of possible marks, by votes and then a fit.

Lines along the road meet at one point of the picture. The car's heading moves it sideways; an error of the
camera's pitch moves it up or down. `drop` px below the known horizon, a line `y` m beside the camera appears
`left + y * metre * (drop + dip)` px left of the camera's column.
"""

from collections.abc import Callable
from math import exp
from typing import NamedTuple

import cv2
import numpy as np

from selfdrive.common.array_math import each, log, product
from selfdrive.visiond.band_filter import Points, points_at
from selfdrive.visiond.road_view import RoadView

BIN = 0.1  # m, for votes
SIDEWAYS = 4.0  # m, largest lateral position of lines
LEFT_STEP, DIP_STEP = 4.0, 6.0  # px between candidates
SCATTER = 0.005  # share of a line's rows with points by chance, on the cleanest road
AROUND = np.array([[1] * 8 + [0] * 5 + [1] * 8], np.float32) / 16  # averages the bins of y around a line
BESIDE = 0.8  # m from a line, within which points by chance are counted
ROUNDS = (0.30, 0.20, 0.15, 0.15)  # m from a line, where points are used in each round of the fit
ALIKE = 10.0  # this many neighbouring points count as one, because they are not independent
FAINT = 0.02  # share of rows that makes a line probable if there are no other points; a dash is 0.05
BLUR = 0.5, 0.05  # px and m by which a point can miss its mark


class Pose(NamedTuple):
    """Two lines: the point where they meet (px), y (m) of each at the camera, and their probabilities: 0 if
    there are no more points than by chance."""

    left: float
    dip: float
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


class Belief(NamedTuple):
    """The expected pose, each value with its standard deviation."""

    middle: tuple[float, float] = (0.0, 0.8)  # m
    width: tuple[float, float] = (3.7, 0.42)  # m
    left: tuple[float, float] = (0.0, 40.0)  # px
    dip: tuple[float, float] = (0.0, 6.0)  # px


class Voters:
    """The points, in px left of the camera's column and below the horizon; `weight` in rows.

    `rows` is the number of the picture's rows that can have points.
    """

    def __init__(self, view: RoadView, points: Points, rows: float) -> None:
        scale = view.scale[points.row]
        self.left = view.y[points.column] * scale
        self.drop = view.drop[points.row]
        self.metre = scale / self.drop
        self.weight = points.weight * view.share[points.row]
        self.precision = self.weight / (ALIKE * (BLUR[0] + BLUR[1] * scale) ** 2)
        self.rows = max(rows, 1.0)


Vote = Callable[[RoadView, np.ndarray, np.ndarray, np.ndarray, Belief], Pose]


def vote(view: RoadView, road: np.ndarray, at: np.ndarray, weight: np.ndarray, belief: Belief) -> Pose:
    """Find the lines from `belief` and points: positions in the map `road`, and weights (see `crests`)."""
    voters = Voters(view, points_at(at, weight, road), view.rows_with_content(road))
    return fit(elect(voters, belief), voters, belief)


def elect(voters: Voters, belief: Belief) -> Pose:
    left = _candidates(*belief.left, LEFT_STEP)
    dip = _candidates(*belief.dip, DIP_STEP)
    left, dip = np.repeat(left, len(dip)), np.tile(dip, len(left))
    votes = _votes(voters, left, dip)
    around = cv2.filter2D(votes, -1, AROUND, borderType=cv2.BORDER_REFLECT)
    support = log(np.float32(1.0) + np.maximum(votes - around, 0.0) / (around + np.float32(SCATTER)))
    support -= (0.25 * (_unlikely(left, *belief.left) + _unlikely(dip, *belief.dip)))[:, None]
    y = SIDEWAYS - BIN * (np.arange(votes.shape[1]) + 0.5)
    best, found = -np.inf, (0, 0, 0)
    for width in _candidates(*belief.width, BIN):
        lane = round(float(width) / BIN)
        pairs = support[:, :-lane] + support[:, lane:]
        middle = 0.5 * (y[:-lane] + y[lane:])
        pairs -= 0.5 * (_unlikely(middle, *belief.middle) + _unlikely(width, *belief.width))
        at = int(np.argmax(pairs))
        if pairs.flat[at] > best:
            best, found = float(pairs.flat[at]), (*divmod(at, pairs.shape[1]), lane)
    which, column, lane = found
    return Pose(float(left[which]), float(dip[which]), float(y[column]), float(y[column + lane]))


def _candidates(mean: float, sigma: float, step: float) -> np.ndarray:
    n = int(2.0 * sigma / step)
    return (mean + step * np.arange(-n, n + 1)).astype(np.float32)


def _unlikely(value: np.ndarray, mean: float, sigma: float) -> np.ndarray:
    return (((value - mean) / sigma) ** 2).astype(np.float32)


def _votes(voters: Voters, left: np.ndarray, dip: np.ndarray) -> np.ndarray:
    """Share of rows with a point, by candidate and by y; each point is counted in about three bins of y."""
    bins, outside = round(2 * SIDEWAYS / BIN), 1
    y = (voters.left - left[:, None]) / (voters.metre * (voters.drop + dip[:, None]))
    column = ((SIDEWAYS - y) * np.float32(1.0 / BIN) + outside).astype(np.int32)
    np.clip(column, 0, bins + outside, out=column)
    column += (np.arange(len(left), dtype=np.int32) * (bins + 2 * outside))[:, None]
    votes = np.bincount(
        column.ravel(),
        weights=np.broadcast_to(voters.weight, column.shape).ravel(),
        minlength=len(left) * (bins + 2 * outside),
    )
    votes = votes.reshape(len(left), -1)[:, outside:-outside].astype(np.float32) / voters.rows
    return cv2.filter2D(votes, -1, np.float32([[0.5, 1.0, 0.5]]), borderType=cv2.BORDER_CONSTANT)


class Fitted(NamedTuple):
    """The result of the fit, `state` (4), and the values of its last step before the state moved.

    `metre` is px per m at each of n points; `error` (px) and `count` (weight) are by line and point (2, n).
    """

    state: np.ndarray
    metre: np.ndarray
    error: np.ndarray
    count: np.ndarray


def settled(state: np.ndarray, voters: Voters, expected: np.ndarray, believed: np.ndarray) -> Fitted:
    """Move `state` (left, dip, y_left, y_right) by weighted Gauss-Newton steps.

    Points further from a line have less weight. `expected` (4, 4) times the state should be `believed`.
    """
    n = len(voters.left)
    terms = np.zeros((5, 2, n))  # negative derivatives of the error for each unknown, and the error
    terms[0] = 1.0
    prior = product(expected.T, expected)
    for near in ROUNDS:
        metre = voters.metre * (voters.drop + state[1])
        y = state[2:, None]
        error = voters.left - state[0] - y * metre
        count = np.maximum(1.0 - (error / (metre * near)) ** 2, 0.0)
        terms[1] = y * voters.metre
        terms[2, 0] = terms[3, 1] = metre
        terms[4] = error
        design = terms.reshape(5, 2 * n)
        sums = product(design, (design[:4] * (count * voters.precision).reshape(-1)).T)
        surprise = believed - (expected * state).sum(axis=1)
        pull = sums[4] + (expected.T * surprise).sum(axis=1)
        state = state + _solved(sums[:4] + prior, pull)
    return Fitted(state, metre, error, count)


def fit(pose: Pose, voters: Voters, belief: Belief) -> Pose:
    """Fit `pose` to the points around its lines; `belief` determines what the points do not."""
    means, sigmas = np.array([belief.left, belief.dip, belief.middle, belief.width]).T
    expected = np.array([(1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 0.5, 0.5), (0, 0, 1, -1)]) / sigmas[:, None]
    state, metre, error, count = settled(np.array(pose[:4]), voters, expected, means / sigmas)
    near = ROUNDS[-1]
    off = np.abs(error / metre)
    beside = (((off > near) & (off < BESIDE)) * voters.weight).sum(axis=1) / voters.rows
    chance = beside * (4.0 / 3.0 * near / (2.0 * (BESIDE - near)))
    seen = np.maximum((count * voters.weight).sum(axis=1) / voters.rows - chance, 0.0)
    prob = 1.0 - each(exp, -seen / (FAINT + chance))
    return Pose(*state.tolist(), *prob.tolist())


def _solved(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Solve matrix * x = right for a positive definite matrix, by elimination."""
    rows = np.column_stack((matrix, right)).tolist()
    for i, pivot in enumerate(rows):
        for row in rows[:i] + rows[i + 1 :]:
            factor = row[i] / pivot[i]
            row[:] = [x - factor * y for x, y in zip(row, pivot, strict=True)]
    return np.array([row[-1] / row[i] for i, row in enumerate(rows)])
