"""The camera's frame, with the detected lines, path and lead drawn in."""

from collections.abc import Sequence
from functools import cached_property
from math import cos, isfinite, sin

import cv2
import numpy as np

from selfdrive.common.camera_model import CameraModel
from selfdrive.sim.film import drawing
from selfdrive.sim.film.film_recorder import SAMPLE_DISTANCES
from selfdrive.sim.film.recorded_film import DetectedLine, FilmFrame
from selfdrive.sim.lead_picture import (
    CAMERA_TO_BUMPER,
    CAR_HEIGHT,
    FARTHEST_DRAWN,
    draw_lead,
    is_before_camera,
)
from selfdrive.sim.road_renderer import RoadRenderer

LINE_HALF_WIDTH, PATH_HALF_WIDTH = 0.06, 0.8  # m; half the drawn width
LINE_OPACITY, PATH_OPACITY = 0.8, 0.3  # opacity over the picture
LEAD_FRAME_HALF_WIDTH = 1.0  # m; of the frame around the lead
MIN_TURN_DISTANCE = 4.0  # m; a nearer lead is not turned further
LEAD_FRAME_MARGIN = 4  # pixels
MIN_SHOWN_DISTANCE_ERROR = 2.0  # m; a larger error of the camera's message is drawn


class CameraPane:
    def __init__(self, model: CameraModel, width: int, height: int) -> None:
        self._model, self._width = model, width
        self._scale = width / model.width
        self._top = height - round(model.rows * self._scale)  # top row of the picture; can be < 0
        near = max(0.0, model.distance(model.rows - 1.0))
        self._strip_x = np.concatenate([[near], np.arange(np.ceil(near + 0.1), SAMPLE_DISTANCES[-1] + 1.0)])

    @cached_property
    def _road_renderer(self) -> RoadRenderer:
        return RoadRenderer(self._model, "solid", 0)

    def draw(self, frame: FilmFrame) -> np.ndarray:
        pane = self._scale_to_pane(self._compose_picture(frame))
        if np.isfinite(frame.plan).all():
            drawing.fill_translucent(
                pane, self._strip_outline(frame.plan, PATH_HALF_WIDTH), drawing.PATH, PATH_OPACITY
            )
        for line in (frame.lines or {}).values():
            self._draw_line(pane, line)
        self._draw_leads(pane, frame)
        return pane

    def _compose_picture(self, frame: FilmFrame) -> np.ndarray:
        grey = frame.load_picture()
        if grey is None:
            picture = self._road_renderer.render_colour(frame.position, -frame.middle, frame.heading)
            picture = self._bend_picture(picture, frame)
        else:
            picture = cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR)
        if frame.d_rel is not None:
            turn = -self._road_shift(frame, frame.d_rel) / max(frame.d_rel, MIN_TURN_DISTANCE)
            draw_lead(picture, self._model, frame.d_rel, -frame.middle, turn)
        return picture

    def _bend_picture(self, picture: np.ndarray, frame: FilmFrame) -> np.ndarray:
        model = self._model
        bend = np.array(frame.bend) + np.tan(frame.heading) * np.array(SAMPLE_DISTANCES)
        if np.allclose(bend, 0.0, atol=1e-6):
            return picture
        rows = np.arange(model.rows)
        below = np.maximum(rows - model.horizon, 1.0)
        depth = model.height * model.fy / (below * cos(model.pitch))
        x = np.maximum((depth - model.height * sin(model.pitch)) / cos(model.pitch), 0.0)
        beyond = (
            np.maximum(x - SAMPLE_DISTANCES[-1], 0.0)
            * (bend[-1] - bend[-2])
            / (SAMPLE_DISTANCES[-1] - SAMPLE_DISTANCES[-2])
        )
        shift = model.fx * (np.interp(x, SAMPLE_DISTANCES, bend) + beyond) / depth
        columns = np.arange(model.width)[None, :] + shift[:, None]
        lines = np.broadcast_to(rows[:, None], columns.shape)
        return cv2.remap(
            picture,
            columns.astype(np.float32),
            lines.astype(np.float32),
            cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_REPLICATE,
        )

    def _scale_to_pane(self, picture: np.ndarray) -> np.ndarray:
        width = self._width
        rows = round(self._model.rows * self._scale)
        scaled = cv2.resize(picture, (width, rows), interpolation=cv2.INTER_LINEAR)
        if self._top <= 0:
            return np.ascontiguousarray(scaled[-self._top :])
        return np.concatenate([np.full((self._top, width, 3), drawing.PANEL, np.uint8), scaled])

    def _draw_line(self, pane: np.ndarray, line: DetectedLine) -> None:
        if line.is_drawable:
            drawing.fill_translucent(
                pane,
                self._strip_outline(line.y, LINE_HALF_WIDTH),
                drawing.line_colour(line.prob),
                LINE_OPACITY,
            )

    def _draw_leads(self, pane: np.ndarray, frame: FilmFrame) -> None:
        detected_distance = frame.camera_lead
        if frame.d_rel is not None:
            self._outline_lead(pane, frame, frame.d_rel, drawing.INK, f"{frame.d_rel:.1f} m")
        has_both_distances = (
            detected_distance is not None and isfinite(detected_distance) and frame.d_rel is not None
        )
        if has_both_distances and abs(detected_distance - frame.d_rel) > MIN_SHOWN_DISTANCE_ERROR:
            self._outline_lead(
                pane, frame, detected_distance, drawing.UNCERTAIN, f"seen at {detected_distance:.1f} m"
            )

    def _outline_lead(
        self, pane: np.ndarray, frame: FilmFrame, distance: float, colour: drawing.Colour, label: str
    ) -> None:
        x = distance + CAMERA_TO_BUMPER
        if x > FARTHEST_DRAWN or not is_before_camera(self._model, x):
            return
        y = frame.middle + self._road_shift(frame, distance)
        corners = [(x, y + LEAD_FRAME_HALF_WIDTH, CAR_HEIGHT), (x, y - LEAD_FRAME_HALF_WIDTH, 0.0)]
        left, top, right, bottom = (
            round(part) for corner in corners for part in self._picture_to_pane(*self._model.project(*corner))
        )
        left, top, right, bottom = (
            left - LEAD_FRAME_MARGIN,
            top - LEAD_FRAME_MARGIN,
            right + LEAD_FRAME_MARGIN,
            bottom + 2,
        )
        arm = max(4, (right - left) // 4)
        for at, way in ((left, 1), (right, -1)):
            for end in (top, bottom):
                up = arm if end == top else -arm
                shape = np.array([(at + way * arm, end), (at, end), (at, end + up)], float)
                drawing.draw_polyline(pane, shape, colour, 1)
        drawing.draw_tag(pane, label, (right + 8, top + 10), colour)

    def _road_shift(self, frame: FilmFrame, distance: float) -> float:
        beyond = (
            max(0.0, distance - SAMPLE_DISTANCES[-1])
            * (frame.bend[-1] - frame.bend[-2])
            / (SAMPLE_DISTANCES[-1] - SAMPLE_DISTANCES[-2])
        )
        return float(np.interp(distance, SAMPLE_DISTANCES, frame.bend)) + beyond

    def _strip_outline(self, knots: Sequence[float], half_width: float) -> np.ndarray:
        y = np.interp(self._strip_x, SAMPLE_DISTANCES, knots)
        sides = [
            self._road_to_pane(self._strip_x, y + half_width),
            self._road_to_pane(self._strip_x, y - half_width)[::-1],
        ]
        return np.concatenate(sides)

    def _road_to_pane(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        model = self._model
        depth = x * cos(model.pitch) + model.height * sin(model.pitch)
        row = model.horizon + model.fy * model.height / (depth * cos(model.pitch))
        return np.stack(self._picture_to_pane(model.cx - model.fx * y / depth, row), axis=1)

    def _picture_to_pane(self, column: float, row: float) -> tuple[float, float]:
        return (column + 0.5) * self._scale - 0.5, (row + 0.5) * self._scale - 0.5 + self._top
