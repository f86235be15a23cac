"""Offset and distance of both runs over time, with event marks and a cursor."""

from collections.abc import Callable, Sequence
from math import ceil

import cv2
import numpy as np

from selfdrive.sim.film import drawing
from selfdrive.sim.film.film_events import FilmEvents, TimelineMark
from selfdrive.sim.film.recorded_film import FilmFrame, RecordedFilm
from selfdrive.sim.hazards import LANE_DEPARTURE_OFFSET

MARK_COLOURS = {
    "trigger": drawing.TRIGGER,
    "manifest": drawing.MANIFESTED,
    "alert": drawing.ALERT,
    "hazard": drawing.HAZARD,
}
LABELS_WIDTH = 86  # pixels left of the plots, for their names
FOOT_HEIGHT, HEAD_HEIGHT = 18, 18  # pixels below the plots (seconds) and above them (marks)
GAP = 6  # pixels between plots and between labels
TICK_STEPS = (1.0, 2.0, 5.0, 10.0, 20.0, 60.0)  # s
MOST_TICKS = 16  # labels of more would touch
MIN_OFFSET_SPAN, MOST_OFFSET_SPAN = 0.3, 4.0  # m; limits of the plot's range
# m; the plot reaches at least the first, and not below the second
MIN_DISTANCE_SPAN, MIN_DISTANCE_SHOWN = 10.0, -10.0


class Timeline:
    def __init__(
        self, width: int, height: int, golden: RecordedFilm, faulty: RecordedFilm, events: FilmEvents
    ) -> None:
        self._size = width, height
        self._end = max(reel.frames[-1].t for reel in (golden, faulty)) or 1.0
        self._canvas = np.full((height, width, 3), drawing.PAPER, np.uint8)
        self._draw_seconds()
        rows = (height - FOOT_HEIGHT - HEAD_HEIGHT - GAP) // 2
        reels = ((golden, drawing.GOLDEN, 2), (faulty, drawing.FAULTY, 1))
        self._drive_end = self._end if events.drive_end is None else events.drive_end
        self._plot_runs("offset [m]", HEAD_HEIGHT, rows, _offset, reels, LANE_DEPARTURE_OFFSET)
        self._plot_runs("lead [m]", HEAD_HEIGHT + rows + GAP, rows, _distance, reels, None)
        if events.active_span:
            self._shade_span(*events.active_span)
        self._draw_marks(events.marks)
        drawing.grey_out(self._canvas[:, round(self._time_to_x(self._drive_end)) + 2 :])

    def draw(self, t: float) -> np.ndarray:
        canvas = self._canvas.copy()
        x = round(self._time_to_x(t))
        cv2.line(canvas, (x, HEAD_HEIGHT - 2), (x, self._size[1] - FOOT_HEIGHT), drawing.INK, 1)
        cv2.circle(canvas, (x, HEAD_HEIGHT - 2), 4, drawing.INK, cv2.FILLED, cv2.LINE_AA)
        return canvas

    def _time_to_x(self, t: float) -> float:
        return LABELS_WIDTH + (self._size[0] - LABELS_WIDTH - 10) * t / self._end

    def _draw_seconds(self) -> None:
        step = next((tick for tick in TICK_STEPS if self._end / tick <= MOST_TICKS), TICK_STEPS[-1])
        foot = self._size[1] - FOOT_HEIGHT
        for i in range(ceil(self._end / step + 1e-9)):
            x = round(self._time_to_x(i * step))
            cv2.line(self._canvas, (x, HEAD_HEIGHT), (x, foot + 3), drawing.RULE, 1)
            label = f"{i * step:g}"
            drawing.write_text(
                self._canvas,
                label,
                (x - drawing.text_width(label, drawing.SMALL_TEXT) // 2, foot + 16),
                drawing.DIM,
                drawing.SMALL_TEXT,
            )
        drawing.write_text(self._canvas, "time [s]", (8, foot + 16), drawing.DIM, drawing.SMALL_TEXT)

    def _plot_runs(
        self,
        name: str,
        top: int,
        rows: int,
        value: Callable[[FilmFrame], float],
        reels: Sequence[tuple[RecordedFilm, drawing.Colour, int]],
        limit: float | None,
    ) -> None:
        """Plot both runs; `limit` is drawn on either side of zero if a value comes near it."""
        cv2.rectangle(
            self._canvas, (LABELS_WIDTH, top), (self._size[0] - 10, top + rows), drawing.PANEL, cv2.FILLED
        )
        series = [(np.array([value(frame) for frame in reel.frames]), reel) for reel, _, _ in reels]
        driven = [values[[f.t <= self._drive_end for f in reel.frames]] for values, reel in series]
        low, high = _value_range(np.concatenate(driven), symmetric=limit is not None)

        def to_row(values: np.ndarray) -> np.ndarray:
            return top + 3 + (rows - 6) * (high - np.clip(values, low, high)) / (high - low)

        for level in () if limit is None or high < limit else (limit, -limit):
            row = round(float(to_row(np.array(level))))
            for x in range(LABELS_WIDTH, self._size[0] - 10, 8):
                cv2.line(self._canvas, (x, row), (x + 3, row), drawing.HAZARD, 1)
        for (values, reel), (_, colour, thickness) in zip(series, reels, strict=True):
            x = self._time_to_x(np.array([frame.t for frame in reel.frames]))
            for part in _slices_of_true(np.isfinite(values)):
                drawing.draw_polyline(
                    self._canvas, np.stack([x[part], to_row(values[part])], axis=1), colour, thickness
                )
        drawing.write_text(self._canvas, name, (8, top + rows // 2 + 5), drawing.DIM, drawing.SMALL_TEXT)
        for level, row in ((high, top + 9), (low, top + rows)):
            label = f"{level:.3g}"
            drawing.write_text(
                self._canvas,
                label,
                (LABELS_WIDTH - 6 - drawing.text_width(label, 0.34), row),
                drawing.DIM,
                0.34,
            )

    def _shade_span(self, first: float, last: float) -> None:
        part = self._canvas[
            HEAD_HEIGHT : self._size[1] - FOOT_HEIGHT,
            round(self._time_to_x(first)) : round(self._time_to_x(last)) + 1,
        ]
        cv2.addWeighted(part, 0.85, np.full_like(part, drawing.FAULTY), 0.15, 0.0, dst=part)

    def _draw_marks(self, marks: Sequence[TimelineMark]) -> None:
        labels_end = 0
        for mark in sorted(marks, key=lambda mark: mark.t):
            x, colour = round(self._time_to_x(mark.t)), MARK_COLOURS.get(mark.kind, drawing.DIM)
            cv2.line(self._canvas, (x, HEAD_HEIGHT - 4), (x, self._size[1] - FOOT_HEIGHT), colour, 1)
            label = f"{mark.label} {mark.t:.2f}"
            columns = drawing.text_width(label, drawing.SMALL_TEXT)
            # A label moves right rather than overlap the one before; if it does not fit, only its line stays.
            label_left = max(labels_end, min(x - 2, self._size[0] - columns - 4))
            if label_left + columns <= self._size[0]:
                drawing.write_text(
                    self._canvas, label, (label_left, HEAD_HEIGHT - 7), colour, drawing.SMALL_TEXT
                )
                labels_end = label_left + columns + 2 * GAP


def _offset(frame: FilmFrame) -> float:
    return frame.offset


def _distance(frame: FilmFrame) -> float:
    return float("nan") if frame.d_rel is None else frame.d_rel


def _value_range(values: np.ndarray, *, symmetric: bool) -> tuple[float, float]:
    finite = values[np.isfinite(values)]
    if symmetric:
        most = min(max(MIN_OFFSET_SPAN, 1.1 * float(np.abs(finite).max(initial=0.0))), MOST_OFFSET_SPAN)
        return -most, most
    most = float(finite.max(initial=MIN_DISTANCE_SPAN))
    return max(MIN_DISTANCE_SHOWN, float(finite.min(initial=0.0))), most


def _slices_of_true(mask: np.ndarray) -> list[slice]:
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(int)))
    return [slice(first, last) for first, last in zip(edges[::2], edges[1::2], strict=True)]
