"""Fits straight lines to clusters of edges and selects those that bound the lane."""

from math import log, sqrt
from typing import NamedTuple

import numpy as np

from selfdrive.common.array_math import dot
from selfdrive.common.camera_model import CameraModel
from selfdrive.visiond.detector import LANE_WIDTH
from selfdrive.visiond.road_region import RoadRegion

MIN_LINE_PIXELS = 24  # in a cluster, or a line, that is used
MIN_ROW_SPREAD = 3.0  # standard deviation of its rows
MAX_SLOPE = 0.15  # lines that diverge more from the car's heading do not bound its lane
NEAREST_LINE_DISTANCE = 8.0  # m ahead, where the nearest line is determined
RIVAL_LINES_DISTANCE = 0.8  # m; of lines this close to each other, the one with more edges is used
MOST_TRIED_CLUSTERS = 8  # clusters examined on each side, from the nearest
FIT_ROUND_REACHES = 0.3, 0.2  # m; distance of edges that belong to a line, in each round of fitting
MIN_SHARE_OF_EITHER_EDGE = 0.12  # smallest share of a mark's edges that lead into the paint, and out of it
MARK_WIDTH_RANGE = 0.03, 0.45  # m between both kinds of edges, for one or two strips of paint
MIN_MEAN_SQUARE = 1e-4  # m^2, added to a mean square distance before its logarithm is taken
MOST_PAINT_EDGE_SPREAD = 0.05  # m, standard deviation of the edges on one side of a strip of paint


class FittedLine(NamedTuple):
    """A line through edges: `y` (m, left positive) at the car, then y + slope * x.

    Of its edges: `pixels` is their number, `row_spread` the standard deviation of their rows, `mean_square`
    that of their distances (m^2), `balance` the share of the rarer kind of edge, `width` the distance (m)
    from the edges that lead into the paint to those that lead out of it.
    """

    y: float
    slope: float
    pixels: float
    row_spread: float
    mean_square: float
    balance: float
    width: float


EVIDENCE_NAMES = (
    *("log of pixels", "log of row spread", "log of mean square", "balance", "width", "squared width"),
    *("squared slope", "squared offset", "other line", "log of other pixels", "squared lane width"),
)


def line_evidence(line: FittedLine, side: float, other: FittedLine | None) -> tuple[float, ...]:
    """The evidence, in the order of EVIDENCE_NAMES, for a line on a `side` of the car (1 left, -1 right).

    Offset and lane width are relative to the usual ones, `NEAREST_LINE_DISTANCE` ahead.
    """
    away = side * (line.y + NEAREST_LINE_DISTANCE * line.slope)
    about_other = (0.0, 0.0, 0.0)
    if other:
        lane = away - side * (other.y + NEAREST_LINE_DISTANCE * other.slope)
        about_other = (1.0, log(other.pixels / MIN_LINE_PIXELS), (lane - LANE_WIDTH) ** 2)
    return (
        log(line.pixels / MIN_LINE_PIXELS),
        log(line.row_spread),
        log(line.mean_square + MIN_MEAN_SQUARE),
        line.balance,
        line.width,
        line.width**2,
        line.slope**2,
        (away - 0.5 * LANE_WIDTH) ** 2,
        *about_other,
    )


class EdgePoints(NamedTuple):
    """Edge pixels: row and column in the picture, whether it gets brighter to the right, m per pixel."""

    row: np.ndarray
    column: np.ndarray
    rising: np.ndarray
    scale: np.ndarray

    def take(self, chosen: np.ndarray) -> "EdgePoints":
        return EdgePoints(*[part.take(chosen) for part in self])


class EdgeLines:
    """Fits lines in the region of one camera's pictures, in road coordinates.

    `scale` is m per pixel in each row of the region.
    """

    def __init__(self, model: CameraModel, region: RoadRegion) -> None:
        self._model = model
        self._region = region
        rows = np.arange(region.shape[0]) + region.first_row
        self.scale = np.array([model.metres_per_pixel(row) for row in rows])

    def nearest_lines(
        self, at: np.ndarray, rising: np.ndarray, labels: np.ndarray
    ) -> tuple[FittedLine | None, FittedLine | None]:
        """The lines next to the car, left and right, among the edges at the pixels `at` (row-major).

        `rising` says for each edge whether the picture gets brighter to the right; `labels` are its clusters.
        """
        clustered = labels >= 0
        if not clustered.any():
            return None, None
        if not clustered.all():
            at, rising, labels = at[clustered], rising[clustered], labels[clustered]
        points = self._edge_points(at, rising)
        size, spread, a, b = _fit_clusters(points.row, points.column, labels)
        y, slope = self._model.line_on_road(a, b)
        usable = (size >= MIN_LINE_PIXELS) & (spread >= MIN_ROW_SPREAD) & (np.abs(slope) <= MAX_SLOPE)
        sides = []
        for side in (1.0, -1.0):
            away = np.where(usable, side * (y + NEAREST_LINE_DISTANCE * slope), -1.0)
            order = np.argsort(away, kind="stable")
            order = order[away[order] >= 0.0][:MOST_TRIED_CLUSTERS]
            clusters = np.stack((away, a, b), axis=1)[order].tolist()
            sides.append(self._nearest_line(clusters, points))
        return sides[0], sides[1]

    def _edge_points(self, at: np.ndarray, rising: np.ndarray) -> EdgePoints:
        region = self._region
        row = at // region.shape[1]
        column = at - row * region.shape[1]
        return EdgePoints(
            (row + region.first_row).astype(float),
            (column + region.first_column).astype(float),
            rising,
            self.scale.take(row),
        )

    def _nearest_line(self, clusters: list[list[float]], points: EdgePoints) -> FittedLine | None:
        best, first, most_pixels, best_distance = None, 0.0, 0.0, 0.0
        for distance, a, b in clusters:
            if best is not None and (
                distance > first + RIVAL_LINES_DISTANCE or distance < best_distance + FIT_ROUND_REACHES[0]
            ):
                continue
            line = self._fit_mark(a, b, points)
            if line is not None and line.pixels > most_pixels:
                first = first if best else distance
                best, most_pixels, best_distance = line, line.pixels, distance
        return best

    def _fit_mark(self, a: float, b: float, points: EdgePoints) -> FittedLine | None:
        """The line through all edges near column = a * row + b; None if they are not a mark."""
        near = points
        for reach in FIT_ROUND_REACHES:
            away = np.abs(_distances_from_line(near, a, b))
            near = near.take((away <= reach).nonzero()[0])
            if near.row.size < MIN_LINE_PIXELS:
                return None
            spread, a, b = _fit_line(near.row, near.column)
        y, slope = self._model.line_on_road(a, b)
        away = _distances_from_line(near, a, b)
        if spread < MIN_ROW_SPREAD or abs(slope) > MAX_SLOPE or not _is_mark(away, near.rising):
            return None
        brighter, darker = away[near.rising], away[~near.rising]
        return FittedLine(
            y=y,
            slope=slope,
            pixels=float(away.size),
            row_spread=spread,
            mean_square=dot(away, away) / away.size,
            balance=min(brighter.size, darker.size) / away.size,
            width=_mean_distance(brighter, darker),
        )


def _distances_from_line(points: EdgePoints, a: float, b: float) -> np.ndarray:
    away = points.column - a * points.row
    away -= b
    away *= points.scale
    return away


def _is_mark(away: np.ndarray, rising: np.ndarray) -> bool:
    """Whether the picture gets brighter left of the line's middle, and darker right of it.

    `away` (m, right positive) is each edge's distance from the middle. At a shadow's edge, there is only one
    of these changes; at a dark seam, they are reversed. The far edge of a seam beside the paint is ignored;
    the other edges must be as sharp as paint.
    """
    brighter, darker = away[rising], away[~rising]
    least = MIN_SHARE_OF_EITHER_EDGE * away.size
    if min(brighter.size, darker.size) < least:
        return False
    if _is_strip_of_paint(brighter, darker):
        return True
    pairs = (
        (brighter, darker[darker > np.median(brighter)]),  # a seam left of the paint
        (brighter[brighter < np.median(darker)], darker),  # right of it
    )
    return any(
        min(up.size, down.size) >= least
        and max(up.std(), down.std()) <= MOST_PAINT_EDGE_SPREAD
        and _is_strip_of_paint(up, down)
        for up, down in pairs
    )


def _is_strip_of_paint(brighter: np.ndarray, darker: np.ndarray) -> bool:
    return MARK_WIDTH_RANGE[0] <= _mean_distance(brighter, darker) <= MARK_WIDTH_RANGE[1]


def _mean_distance(brighter: np.ndarray, darker: np.ndarray) -> float:
    return float(darker.sum()) / darker.size - float(brighter.sum()) / brighter.size


def _fit_line(row: np.ndarray, column: np.ndarray) -> tuple[float, float, float]:
    """Standard deviation of the rows, a and b of column = a * row + b."""
    mean_row, mean_column = float(row.sum()) / row.size, float(column.sum()) / row.size
    down = row - mean_row
    power = dot(down, down)
    a = dot(down, column) / max(power, 1.0)
    return sqrt(power / row.size), a, mean_column - a * mean_row


def _fit_clusters(
    row: np.ndarray, column: np.ndarray, label: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """For each cluster: number of pixels, and the result of `_fit_line`."""
    size = np.bincount(label)
    mean_row, mean_column = (np.bincount(label, value) / size for value in (row, column))
    down, across = row - mean_row.take(label), column - mean_column.take(label)
    power = np.bincount(label, down * down)
    a = np.bincount(label, down * across) / np.maximum(power, 1.0)
    return size, np.sqrt(power / size), a, mean_column - a * mean_row
