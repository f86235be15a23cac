"""One picture of a film of two runs: golden on the left, faulty on the right, timeline below."""

import cv2
import numpy as np

from selfdrive.common.conversions import MPH_TO_MS
from selfdrive.sim.film import drawing
from selfdrive.sim.film.birds_eye import BirdsEyeView
from selfdrive.sim.film.camera_pane import CameraPane
from selfdrive.sim.film.film_events import FilmEvents
from selfdrive.sim.film.recorded_film import FilmFrame, RecordedFilm
from selfdrive.sim.film.timeline import Timeline
from selfdrive.sim.recorder import COUNTED_ALERTS

WIDTH, HEIGHT = 1280, 720  # pixels, a size that every player supports
MARGIN = 8
# Heading, panes, captions and strips leave the rest of HEIGHT to the timeline.
HEADING_HEIGHT = 42
PANE_SIZE = 628, 404
CAPTION_HEIGHT = 26
STRIP_HEIGHT = 104
CAPTION_COLUMNS = (0, 104, 204, 330, 468)  # pixels; of the caption
OUTCOME_COLOURS = {"hazard": drawing.HAZARD, "sdc": drawing.ALERT, "masked": drawing.MANIFESTED}


class SideBySideView:
    def __init__(self, golden: RecordedFilm, faulty: RecordedFilm, events: FilmEvents) -> None:
        self._events = events
        panes = {reel.camera: CameraPane(reel.camera, *PANE_SIZE) for reel in (golden, faulty)}
        self._sides = tuple(
            _RunColumn(reel, name, colour, events, panes[reel.camera])
            for reel, name, colour in ((golden, "golden", drawing.GOLDEN), (faulty, "faulty", drawing.FAULTY))
        )
        self.picture_count = max(len(golden.frames), len(faulty.frames))
        self._reels = golden, faulty
        top = HEADING_HEIGHT + PANE_SIZE[1] + CAPTION_HEIGHT + STRIP_HEIGHT + MARGIN
        self._timeline = Timeline(WIDTH, HEIGHT - top, golden, faulty, events)
        self._canvas = np.full((HEIGHT, WIDTH, 3), drawing.PAPER, np.uint8)
        self._draw_heading()

    def time_of(self, index: int) -> float:
        return max(reel.frame_at(index).t for reel in self._reels)

    def nearest_index(self, t: float) -> int:
        return min(range(self.picture_count), key=lambda index: abs(self.time_of(index) - t))

    def draw(self, index: int) -> np.ndarray:
        canvas, t = self._canvas.copy(), self.time_of(index)
        for side, side_left in zip(self._sides, (MARGIN, WIDTH - MARGIN - PANE_SIZE[0]), strict=True):
            block = side.draw(index)
            canvas[HEADING_HEIGHT : HEADING_HEIGHT + len(block), side_left : side_left + PANE_SIZE[0]] = block
        timeline = self._timeline.draw(t)
        canvas[HEIGHT - len(timeline) :] = timeline
        return canvas

    def _draw_heading(self) -> None:
        outcome = self._events.outcome.replace("_", " ").upper()
        chip_left = WIDTH - MARGIN - drawing.chip_width(outcome)
        colour = OUTCOME_COLOURS.get(self._events.outcome, drawing.DIM)
        drawing.draw_chip(
            self._canvas,
            outcome,
            (chip_left, 10),
            colour,
            drawing.INK if colour == drawing.HAZARD else drawing.PAPER,
        )
        title = drawing.shorten_text(
            self._events.title, chip_left - 3 * MARGIN, drawing.LARGE_TEXT, bold=True
        )
        drawing.write_text(self._canvas, title, (MARGIN + 2, 28), drawing.INK, drawing.LARGE_TEXT, bold=True)


class _RunColumn:
    def __init__(
        self, reel: RecordedFilm, name: str, colour: drawing.Colour, events: FilmEvents, pane: CameraPane
    ) -> None:
        self._reel, self._name, self._colour, self._events = reel, name, colour, events
        self._pane = pane
        self._strip = BirdsEyeView(PANE_SIZE[0], STRIP_HEIGHT, colour)

    def draw(self, index: int) -> np.ndarray:
        frame = self._reel.frame_at(index)
        pane = self._pane.draw(frame)
        if index >= len(self._reel.frames):
            cv2.addWeighted(pane, 0.4, pane, 0.0, 0.0, dst=pane)
            drawing.draw_chip(pane, "the run ended", (PANE_SIZE[0] // 2 - 54, PANE_SIZE[1] // 2), drawing.DIM)
        self._draw_chips(pane, frame)
        self._draw_warnings(pane, frame)
        caption = np.full((CAPTION_HEIGHT, PANE_SIZE[0], 3), drawing.PAPER, np.uint8)
        self._draw_caption(caption, frame)
        block = np.concatenate([pane, caption, self._strip.draw(frame)])
        if self._events.drive_end is not None and frame.t > self._events.drive_end:
            drawing.grey_out(block)
        return block

    def _draw_chips(self, pane: np.ndarray, frame: FilmFrame) -> None:
        drawing.draw_chip(pane, self._name, (8, 8), self._colour)
        active = self._events.active_span if self._name == "faulty" else None
        if active and active[0] <= frame.t <= active[1]:
            words = "fault active"
            drawing.draw_chip(pane, words, (PANE_SIZE[0] - 8 - drawing.chip_width(words), 8), drawing.TRIGGER)

    def _draw_warnings(self, pane: np.ndarray, frame: FilmFrame) -> None:
        alerts = [name for name in frame.alerts if name in COUNTED_ALERTS]
        foot = PANE_SIZE[1]
        if frame.hazards:
            words = ", ".join(frame.hazards)
            if len(frame.hazards) == 1:
                words = f"{words}: {self._events.hazard_names.get(words, '')}".removesuffix(": ")
            foot = _draw_bar(pane, foot, f"HAZARD {words}", drawing.HAZARD, drawing.INK)
            cv2.rectangle(pane, (1, 1), (PANE_SIZE[0] - 2, PANE_SIZE[1] - 2), drawing.HAZARD, 3)
        if alerts:
            _draw_bar(pane, foot, f"{frame.text}   [{', '.join(alerts)}]", drawing.ALERT, drawing.PAPER)

    def _draw_caption(self, caption: np.ndarray, frame: FilmFrame) -> None:
        lead = "free road" if frame.d_rel is None else f"lead {frame.d_rel:6.1f} m"
        words = (
            (f"t = {frame.t:.2f} s", self._colour),
            (f"{frame.v_ego / MPH_TO_MS:5.1f} mph", drawing.INK),
            (lead, drawing.INK),
            (f"offset {frame.offset:+.2f} m", drawing.INK),
            _line_probabilities_text(frame),
        )
        for column, (text, colour) in zip(CAPTION_COLUMNS, words, strict=True):
            drawing.write_text(caption, text, (4 + column, 18), colour)


def _line_probabilities_text(frame: FilmFrame) -> tuple[str, drawing.Colour]:
    if frame.lines is None:
        return "no camera message", drawing.ALERT
    left, right = (frame.lines[name].prob for name in ("left", "right"))
    is_uncertain = not min(left, right) >= drawing.MIN_CERTAIN_PROBABILITY  # also true for NaN
    return f"lines {left:.2f} | {right:.2f}", drawing.ALERT if is_uncertain else drawing.INK


def _draw_bar(pane: np.ndarray, bottom: int, text: str, colour: drawing.Colour, ink: drawing.Colour) -> int:
    top = bottom - 30
    layer = np.full((30, pane.shape[1], 3), colour, np.uint8)
    cv2.addWeighted(layer, 0.9, pane[top:bottom], 0.1, 0.0, dst=pane[top:bottom])
    text = drawing.shorten_text(text, pane.shape[1] - 20, bold=True)
    drawing.write_text(
        pane, text, ((pane.shape[1] - drawing.text_width(text, bold=True)) // 2, top + 20), ink, bold=True
    )
    return top
