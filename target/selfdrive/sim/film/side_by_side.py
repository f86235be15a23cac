"""One picture of a film of two runs: golden on the left, faulty on the right, timeline below."""

import cv2
import numpy as np

from selfdrive.common.conversions import MPH_TO_MS
from selfdrive.sim.film import drawing
from selfdrive.sim.film.birds_eye import BirdsEye
from selfdrive.sim.film.camera_pane import CameraPane
from selfdrive.sim.film.film_events import Events
from selfdrive.sim.film.recorded_film import Frame, Reel
from selfdrive.sim.film.timeline import Timeline
from selfdrive.sim.recorder import COUNTED_ALERTS

WIDTH, HEIGHT = 1280, 720
MARGIN = 8
HEADING = 42
PANE = 628, 404
CAPTION = 26
STRIP = 104
CAPTION_COLUMNS = (0, 104, 204, 330, 468)  # pixels; of the caption
OUTCOMES = {"hazard": drawing.HAZARD, "sdc": drawing.ALERT, "masked": drawing.MANIFESTED}


class Sheet:
    def __init__(self, golden: Reel, faulty: Reel, events: Events) -> None:
        self._events = events
        panes = {reel.camera: CameraPane(reel.camera, *PANE) for reel in (golden, faulty)}
        self._sides = tuple(
            _Side(reel, name, colour, events, panes[reel.camera])
            for reel, name, colour in ((golden, "golden", drawing.GOLDEN), (faulty, "faulty", drawing.FAULTY))
        )
        self.count = max(len(golden.frames), len(faulty.frames))
        self._reels = golden, faulty
        top = HEADING + PANE[1] + CAPTION + STRIP + MARGIN
        self._timeline = Timeline(WIDTH, HEIGHT - top, golden, faulty, events)
        self._canvas = np.full((HEIGHT, WIDTH, 3), drawing.PAPER, np.uint8)
        self._draw_heading()

    def time(self, index: int) -> float:
        return max(reel.at(index).t for reel in self._reels)

    def nearest(self, t: float) -> int:
        return min(range(self.count), key=lambda index: abs(self.time(index) - t))

    def draw(self, index: int) -> np.ndarray:
        canvas, t = self._canvas.copy(), self.time(index)
        for side, left in zip(self._sides, (MARGIN, WIDTH - MARGIN - PANE[0]), strict=True):
            block = side.draw(index)
            canvas[HEADING : HEADING + len(block), left : left + PANE[0]] = block
        timeline = self._timeline.draw(t)
        canvas[HEIGHT - len(timeline) :] = timeline
        return canvas

    def _draw_heading(self) -> None:
        outcome = self._events.outcome.replace("_", " ").upper()
        left = WIDTH - MARGIN - drawing.chip_width(outcome)
        colour = OUTCOMES.get(self._events.outcome, drawing.DIM)
        drawing.chip(
            self._canvas,
            outcome,
            (left, 10),
            colour,
            drawing.INK if colour == drawing.HAZARD else drawing.PAPER,
        )
        title = drawing.shortened(self._events.title, left - 3 * MARGIN, drawing.LARGE, bold=True)
        drawing.write(self._canvas, title, (MARGIN + 2, 28), drawing.INK, drawing.LARGE, bold=True)


class _Side:
    def __init__(
        self, reel: Reel, name: str, colour: drawing.Colour, events: Events, pane: CameraPane
    ) -> None:
        self._reel, self._name, self._colour, self._events = reel, name, colour, events
        self._pane = pane
        self._strip = BirdsEye(PANE[0], STRIP, colour)

    def draw(self, index: int) -> np.ndarray:
        frame = self._reel.at(index)
        pane = self._pane.draw(frame)
        if index >= len(self._reel.frames):
            cv2.addWeighted(pane, 0.4, pane, 0.0, 0.0, dst=pane)
            drawing.chip(pane, "the run ended", (PANE[0] // 2 - 54, PANE[1] // 2), drawing.DIM)
        self._draw_chips(pane, frame)
        self._draw_warnings(pane, frame)
        caption = np.full((CAPTION, PANE[0], 3), drawing.PAPER, np.uint8)
        self._draw_caption(caption, frame)
        block = np.concatenate([pane, caption, self._strip.draw(frame)])
        if self._events.end is not None and frame.t > self._events.end:
            drawing.grey(block)
        return block

    def _draw_chips(self, pane: np.ndarray, frame: Frame) -> None:
        drawing.chip(pane, self._name, (8, 8), self._colour)
        active = self._events.active if self._name == "faulty" else None
        if active and active[0] <= frame.t <= active[1]:
            words = "fault active"
            drawing.chip(pane, words, (PANE[0] - 8 - drawing.chip_width(words), 8), drawing.TRIGGER)

    def _draw_warnings(self, pane: np.ndarray, frame: Frame) -> None:
        alerts = [name for name in frame.alerts if name in COUNTED_ALERTS]
        foot = PANE[1]
        if frame.hazards:
            words = ", ".join(frame.hazards)
            if len(frame.hazards) == 1:
                words = f"{words}: {self._events.names.get(words, '')}".removesuffix(": ")
            foot = _bar(pane, foot, f"HAZARD {words}", drawing.HAZARD, drawing.INK)
            cv2.rectangle(pane, (1, 1), (PANE[0] - 2, PANE[1] - 2), drawing.HAZARD, 3)
        if alerts:
            _bar(pane, foot, f"{frame.text}   [{', '.join(alerts)}]", drawing.ALERT, drawing.PAPER)

    def _draw_caption(self, caption: np.ndarray, frame: Frame) -> None:
        lead = "free road" if frame.d_rel is None else f"lead {frame.d_rel:6.1f} m"
        words = (
            (f"t = {frame.t:.2f} s", self._colour),
            (f"{frame.v_ego / MPH_TO_MS:5.1f} mph", drawing.INK),
            (lead, drawing.INK),
            (f"offset {frame.offset:+.2f} m", drawing.INK),
            _lines_seen(frame),
        )
        for column, (text, colour) in zip(CAPTION_COLUMNS, words, strict=True):
            drawing.write(caption, text, (4 + column, 18), colour)


def _lines_seen(frame: Frame) -> tuple[str, drawing.Colour]:
    if frame.lines is None:
        return "no camera message", drawing.ALERT
    left, right = (frame.lines[name].prob for name in ("left", "right"))
    doubted = not min(left, right) >= drawing.DOUBTFUL  # also true for NaN
    return f"lines {left:.2f} | {right:.2f}", drawing.ALERT if doubted else drawing.INK


def _bar(pane: np.ndarray, foot: int, text: str, colour: drawing.Colour, ink: drawing.Colour) -> int:
    top = foot - 30
    layer = np.full((30, pane.shape[1], 3), colour, np.uint8)
    cv2.addWeighted(layer, 0.9, pane[top:foot], 0.1, 0.0, dst=pane[top:foot])
    text = drawing.shortened(text, pane.shape[1] - 20, bold=True)
    drawing.write(
        pane, text, ((pane.shape[1] - drawing.width(text, bold=True)) // 2, top + 20), ink, bold=True
    )
    return top
