"""The camera's frame, with the detected lines, path and lead drawn in."""

from collections.abc import Sequence
from functools import cached_property
from math import cos, isfinite, sin

import cv2
import numpy as np

from selfdrive.common.camera_model import CameraModel
from selfdrive.sim.film import drawing
from selfdrive.sim.film.film_recorder import KNOTS
from selfdrive.sim.film.recorded_film import Frame, SeenLine
from selfdrive.sim.lead_picture import CAMERA_TO_BUMPER, FURTHEST, NEAREST, draw_lead
from selfdrive.sim.road_renderer import RoadRenderer

LINE_HALF, PATH_HALF = 0.06, 0.8  # m; half the drawn width
LINE_SHARE, PATH_SHARE = 0.8, 0.3  # opacity over the picture
CAR_HALF, CAR_HEIGHT = 1.0, 1.55  # m; of the frame around the lead
FRAME_MARGIN = 4  # pixels
WRONG_DISTANCE = 2.0  # m; a larger error of the camera's message is drawn


class CameraPane:
    def __init__(self, model: CameraModel, width: int, height: int) -> None:
        self._model, self._width = model, width
        self._scale = width / model.width
        self._top = height - round(model.rows * self._scale)  # top row of the picture; can be < 0
        near = max(0.0, model.distance(model.rows - 1.0))
        self._x = np.concatenate([[near], np.arange(np.ceil(near + 0.1), KNOTS[-1] + 1.0)])

    @cached_property
    def _road(self) -> RoadRenderer:
        return RoadRenderer(self._model, "solid", 0)

    def draw(self, frame: Frame) -> np.ndarray:
        pane = self._fitted(self._picture(frame))
        if np.isfinite(frame.plan).all():
            drawing.glaze(pane, self._strip(frame.plan, PATH_HALF), drawing.PATH, PATH_SHARE)
        for line in (frame.lines or {}).values():
            self._draw_line(pane, line)
        self._draw_leads(pane, frame)
        return pane

    def _picture(self, frame: Frame) -> np.ndarray:
        grey = frame.image()
        if grey is None:
            picture = self._road.colour(frame.position, -frame.middle, frame.heading)
            picture = self._bent(picture, frame)
        else:
            picture = cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR)
        if frame.d_rel is not None:
            turn = -self._sideways(frame, frame.d_rel) / max(frame.d_rel, NEAREST)
            draw_lead(picture, self._model, frame.d_rel, -frame.middle, turn)
        return picture

    def _bent(self, picture: np.ndarray, frame: Frame) -> np.ndarray:
        model = self._model
        bend = np.array(frame.bend) + np.tan(frame.heading) * np.array(KNOTS)
        if np.allclose(bend, 0.0, atol=1e-6):
            return picture
        rows = np.arange(model.rows)
        below = np.maximum(rows - model.horizon, 1.0)
        depth = model.height * model.fy / (below * cos(model.pitch))
        x = np.maximum((depth - model.height * sin(model.pitch)) / cos(model.pitch), 0.0)
        beyond = np.maximum(x - KNOTS[-1], 0.0) * (bend[-1] - bend[-2]) / (KNOTS[-1] - KNOTS[-2])
        shift = model.fx * (np.interp(x, KNOTS, bend) + beyond) / depth
        columns = np.arange(model.width)[None, :] + shift[:, None]
        lines = np.broadcast_to(rows[:, None], columns.shape)
        return cv2.remap(
            picture,
            columns.astype(np.float32),
            lines.astype(np.float32),
            cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_REPLICATE,
        )

    def _fitted(self, picture: np.ndarray) -> np.ndarray:
        width = self._width
        rows = round(self._model.rows * self._scale)
        scaled = cv2.resize(picture, (width, rows), interpolation=cv2.INTER_LINEAR)
        if self._top <= 0:
            return np.ascontiguousarray(scaled[-self._top :])
        return np.concatenate([np.full((self._top, width, 3), drawing.PANEL, np.uint8), scaled])

    def _draw_line(self, pane: np.ndarray, line: SeenLine) -> None:
        if line.drawable:
            drawing.glaze(pane, self._strip(line.y, LINE_HALF), drawing.line_colour(line.prob), LINE_SHARE)

    def _draw_leads(self, pane: np.ndarray, frame: Frame) -> None:
        told = frame.camera_lead
        if frame.d_rel is not None:
            self._frame_lead(pane, frame, frame.d_rel, drawing.INK, f"{frame.d_rel:.1f} m")
        wrong = told is not None and isfinite(told) and frame.d_rel is not None
        if wrong and abs(told - frame.d_rel) > WRONG_DISTANCE:
            self._frame_lead(pane, frame, told, drawing.DOUBTED, f"seen at {told:.1f} m")

    def _frame_lead(
        self, pane: np.ndarray, frame: Frame, distance: float, colour: drawing.Colour, label: str
    ) -> None:
        x = distance + CAMERA_TO_BUMPER
        if not NEAREST <= x <= FURTHEST:
            return
        y = frame.middle + self._sideways(frame, distance)
        corners = [(x, y + CAR_HALF, CAR_HEIGHT), (x, y - CAR_HALF, 0.0)]
        left, top, right, bottom = (
            round(part) for corner in corners for part in self._in_pane(*self._model.project(*corner))
        )
        left, top, right, bottom = left - FRAME_MARGIN, top - FRAME_MARGIN, right + FRAME_MARGIN, bottom + 2
        arm = max(4, (right - left) // 4)
        for at, way in ((left, 1), (right, -1)):
            for end in (top, bottom):
                up = arm if end == top else -arm
                shape = np.array([(at + way * arm, end), (at, end), (at, end + up)], float)
                drawing.stroke(pane, shape, colour, 1)
        drawing.tag(pane, label, (right + 8, top + 10), colour)

    def _sideways(self, frame: Frame, distance: float) -> float:
        beyond = max(0.0, distance - KNOTS[-1]) * (frame.bend[-1] - frame.bend[-2]) / (KNOTS[-1] - KNOTS[-2])
        return float(np.interp(distance, KNOTS, frame.bend)) + beyond

    def _strip(self, knots: Sequence[float], half: float) -> np.ndarray:
        y = np.interp(self._x, KNOTS, knots)
        sides = [self._seen_at(self._x, y + half), self._seen_at(self._x, y - half)[::-1]]
        return np.concatenate(sides)

    def _seen_at(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        model = self._model
        depth = x * cos(model.pitch) + model.height * sin(model.pitch)
        row = model.horizon + model.fy * model.height / (depth * cos(model.pitch))
        return np.stack(self._in_pane(model.cx - model.fx * y / depth, row), axis=1)

    def _in_pane(self, column: float, row: float) -> tuple[float, float]:
        return (column + 0.5) * self._scale - 0.5, (row + 0.5) * self._scale - 0.5 + self._top
