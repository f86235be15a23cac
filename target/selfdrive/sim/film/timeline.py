"""Offset and distance of both runs over time, with event marks and a cursor."""

from collections.abc import Callable, Sequence
from math import ceil

import cv2
import numpy as np

from selfdrive.sim.film import drawing
from selfdrive.sim.film.film_events import Events, Mark
from selfdrive.sim.film.recorded_film import Frame, Reel
from selfdrive.sim.hazards import LANE_OFFSET

KINDS = {
    "trigger": drawing.TRIGGER,
    "manifest": drawing.MANIFESTED,
    "alert": drawing.ALERT,
    "hazard": drawing.HAZARD,
}
GUTTER = 86  # pixels left of the plots, for their names
FOOT, HEAD = 18, 18  # pixels below the plots (seconds) and above them (marks)
GAP = 6  # pixels between plots and between labels
TICKS = (1.0, 2.0, 5.0, 10.0, 20.0, 60.0)  # s
MOST_TICKS = 16
LEAST_OFFSET, MOST_OFFSET = 0.3, 4.0  # m; limits of the plot's range
LEAST_DISTANCE, LEAST_GAP = 10.0, -10.0  # m; the plot reaches at least the first, and not below the second


class Timeline:
    def __init__(self, width: int, height: int, golden: Reel, faulty: Reel, events: Events) -> None:
        self._size = width, height
        self._end = max(reel.frames[-1].t for reel in (golden, faulty)) or 1.0
        self._canvas = np.full((height, width, 3), drawing.PAPER, np.uint8)
        self._draw_seconds()
        rows = (height - FOOT - HEAD - GAP) // 2
        reels = ((golden, drawing.GOLDEN, 2), (faulty, drawing.FAULTY, 1))
        self._driven = self._end if events.end is None else events.end
        self._plot("offset [m]", HEAD, rows, _offset, reels, LANE_OFFSET)
        self._plot("lead [m]", HEAD + rows + GAP, rows, _distance, reels, None)
        if events.active:
            self._shade(*events.active)
        self._draw_marks(events.marks)
        drawing.grey(self._canvas[:, round(self._x(self._driven)) + 2 :])

    def draw(self, t: float) -> np.ndarray:
        canvas = self._canvas.copy()
        x = round(self._x(t))
        cv2.line(canvas, (x, HEAD - 2), (x, self._size[1] - FOOT), drawing.INK, 1)
        cv2.circle(canvas, (x, HEAD - 2), 4, drawing.INK, cv2.FILLED, cv2.LINE_AA)
        return canvas

    def _x(self, t: float) -> float:
        return GUTTER + (self._size[0] - GUTTER - 10) * t / self._end

    def _draw_seconds(self) -> None:
        step = next((tick for tick in TICKS if self._end / tick <= MOST_TICKS), TICKS[-1])
        foot = self._size[1] - FOOT
        for i in range(ceil(self._end / step + 1e-9)):
            x = round(self._x(i * step))
            cv2.line(self._canvas, (x, HEAD), (x, foot + 3), drawing.RULE, 1)
            label = f"{i * step:g}"
            drawing.write(
                self._canvas,
                label,
                (x - drawing.width(label, drawing.SMALL) // 2, foot + 16),
                drawing.DIM,
                drawing.SMALL,
            )
        drawing.write(self._canvas, "time [s]", (8, foot + 16), drawing.DIM, drawing.SMALL)

    def _plot(
        self,
        name: str,
        top: int,
        rows: int,
        value: Callable[[Frame], float],
        reels: Sequence[tuple[Reel, drawing.Colour, int]],
        limit: float | None,
    ) -> None:
        """Plot both runs; `limit` is drawn on either side of zero if a value comes near it."""
        cv2.rectangle(
            self._canvas, (GUTTER, top), (self._size[0] - 10, top + rows), drawing.PANEL, cv2.FILLED
        )
        series = [(np.array([value(frame) for frame in reel.frames]), reel) for reel, _, _ in reels]
        driven = [values[[f.t <= self._driven for f in reel.frames]] for values, reel in series]
        low, high = _span(np.concatenate(driven), symmetric=limit is not None)

        def y(values: np.ndarray) -> np.ndarray:
            return top + 3 + (rows - 6) * (high - np.clip(values, low, high)) / (high - low)

        for level in () if limit is None or high < limit else (limit, -limit):
            row = round(float(y(np.array(level))))
            for x in range(GUTTER, self._size[0] - 10, 8):
                cv2.line(self._canvas, (x, row), (x + 3, row), drawing.HAZARD, 1)
        for (values, reel), (_, colour, thickness) in zip(series, reels, strict=True):
            x = self._x(np.array([frame.t for frame in reel.frames]))
            for part in _pieces(np.isfinite(values)):
                drawing.stroke(self._canvas, np.stack([x[part], y(values[part])], axis=1), colour, thickness)
        drawing.write(self._canvas, name, (8, top + rows // 2 + 5), drawing.DIM, drawing.SMALL)
        for level, row in ((high, top + 9), (low, top + rows)):
            label = f"{level:.3g}"
            drawing.write(
                self._canvas, label, (GUTTER - 6 - drawing.width(label, 0.34), row), drawing.DIM, 0.34
            )

    def _shade(self, first: float, last: float) -> None:
        part = self._canvas[HEAD : self._size[1] - FOOT, round(self._x(first)) : round(self._x(last)) + 1]
        cv2.addWeighted(part, 0.85, np.full_like(part, drawing.FAULTY), 0.15, 0.0, dst=part)

    def _draw_marks(self, marks: Sequence[Mark]) -> None:
        taken = 0
        for mark in sorted(marks, key=lambda mark: mark.t):
            x, colour = round(self._x(mark.t)), KINDS.get(mark.kind, drawing.DIM)
            cv2.line(self._canvas, (x, HEAD - 4), (x, self._size[1] - FOOT), colour, 1)
            label = f"{mark.label} {mark.t:.2f}"
            columns = drawing.width(label, drawing.SMALL)
            left = max(taken, min(x - 2, self._size[0] - columns - 4))
            if left + columns <= self._size[0]:
                drawing.write(self._canvas, label, (left, HEAD - 7), colour, drawing.SMALL)
                taken = left + columns + 2 * GAP


def _offset(frame: Frame) -> float:
    return frame.offset


def _distance(frame: Frame) -> float:
    return float("nan") if frame.d_rel is None else frame.d_rel


def _span(values: np.ndarray, *, symmetric: bool) -> tuple[float, float]:
    finite = values[np.isfinite(values)]
    if symmetric:
        most = min(max(LEAST_OFFSET, 1.1 * float(np.abs(finite).max(initial=0.0))), MOST_OFFSET)
        return -most, most
    most = float(finite.max(initial=LEAST_DISTANCE))
    return max(LEAST_GAP, float(finite.min(initial=0.0))), most


def _pieces(there: np.ndarray) -> list[slice]:
    edges = np.flatnonzero(np.diff(np.concatenate([[False], there, [False]]).astype(int)))
    return [slice(first, last) for first, last in zip(edges[::2], edges[1::2], strict=True)]
