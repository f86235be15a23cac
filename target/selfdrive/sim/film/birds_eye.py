"""The road from above, driving to the right: car and lead, and what the controller sees."""

from math import copysign, cos, sin

import cv2
import numpy as np

from selfdrive.sim.camera import LANE_WIDTH
from selfdrive.sim.film import drawing
from selfdrive.sim.film.film_recorder import SAMPLE_DISTANCES
from selfdrive.sim.film.recorded_film import FilmFrame
from selfdrive.sim.hazards import CAR_WIDTH
from selfdrive.sim.lead_picture import CAR_LENGTH

ROAD_COLOUR = (84, 78, 74)
PAINT_COLOUR = (205, 205, 205)
YELLOW_PAINT_COLOUR = (70, 180, 215)
VERGE_COLOUR = (52, 66, 50)
LEAD_COLOUR = (92, 78, 168)
ROAD_SHOWN_BEHIND = 8.0  # m of road shown behind the car's front
SHOULDER_WIDTH = 0.7  # m
DASH_LENGTH, DASH_PERIOD = 3.05, 12.2  # m; of the outer lines, which show the motion
LINE_WIDTH, FAR_LINE_WIDTH = 2, 1  # pixels


class BirdsEyeView:
    """Draws frames into strips of `width` x `height` pixels with three lanes; the car has `colour`."""

    def __init__(self, width: int, height: int, colour: drawing.Colour) -> None:
        self._size, self._colour = (width, height), colour
        self._shift = 0.0  # m, shift of the strip to follow a car that leaves the road
        self._pixels_per_metre = height / (3.0 * LANE_WIDTH + 2.0 * (SHOULDER_WIDTH + 0.3))
        self.road_shown_ahead = width / self._pixels_per_metre - ROAD_SHOWN_BEHIND  # m shown

    def draw(self, frame: FilmFrame) -> np.ndarray:
        self._shift = copysign(max(0.0, abs(frame.offset) - LANE_WIDTH), frame.offset)
        strip = np.full((self._size[1], self._size[0], 3), VERGE_COLOUR, np.uint8)
        self._draw_road(strip, frame.position)
        self._draw_detections(strip, frame)
        if frame.d_rel is not None:
            self._draw_car(strip, frame.d_rel + CAR_LENGTH, 0.0, 0.0, LEAD_COLOUR)
        self._draw_car(strip, 0.0, frame.offset, frame.heading, self._colour)
        self._draw_distances(strip, frame)
        return strip

    def _draw_road(self, strip: np.ndarray, position: float) -> None:
        edge = 1.5 * LANE_WIDTH + SHOULDER_WIDTH
        ends = np.array([-ROAD_SHOWN_BEHIND, self.road_shown_ahead])
        drawing.fill_polygon(
            strip, self._to_pixels([*ends, *ends[::-1]], [edge, edge, -edge, -edge]), ROAD_COLOUR
        )
        half = 0.5 * LANE_WIDTH
        for y, colour in ((half, YELLOW_PAINT_COLOUR), (-half, PAINT_COLOUR)):
            drawing.draw_polyline(strip, self._to_pixels(ends, [y, y]), colour, LINE_WIDTH)
        first = -((position - ROAD_SHOWN_BEHIND) % DASH_PERIOD) - ROAD_SHOWN_BEHIND
        for y in (3.0 * half, -3.0 * half):
            for start in np.arange(first, self.road_shown_ahead, DASH_PERIOD):
                drawing.draw_polyline(
                    strip, self._to_pixels([start, start + DASH_LENGTH], [y, y]), PAINT_COLOUR, FAR_LINE_WIDTH
                )

    def _draw_detections(self, strip: np.ndarray, frame: FilmFrame) -> None:
        drawable_lines = [line for line in (frame.lines or {}).values() if line.is_drawable]
        curves = [(line.y, drawing.line_colour(line.prob), LINE_WIDTH) for line in drawable_lines]
        if np.isfinite(frame.plan).all():
            curves.append((frame.plan, drawing.PATH, 1))
        for y, colour, thickness in curves:
            places = self._to_pixels(SAMPLE_DISTANCES, np.array(y) - frame.bend - frame.middle)
            drawing.draw_polyline(strip, places, colour, thickness)

    def _draw_car(
        self, strip: np.ndarray, front: float, offset: float, heading: float, colour: drawing.Colour
    ) -> None:
        for x, y, tone in (
            ([0.0, 0.0, -CAR_LENGTH, -CAR_LENGTH], 1.0, colour),
            ([-1.2, -1.2, -1.9, -1.9], 0.8, drawing.PAPER),
        ):
            along = np.array(x)
            across = 0.5 * CAR_WIDTH * y * np.array([1.0, -1.0, -1.0, 1.0])
            c, s = cos(heading), sin(heading)
            drawing.fill_polygon(
                strip, self._to_pixels(front + along * c - across * s, offset + along * s + across * c), tone
            )

    def _draw_distances(self, strip: np.ndarray, frame: FilmFrame) -> None:
        for name, distance, colour, side in (
            ("radar", frame.radar, drawing.FAULTY, 1.0),
            ("camera", frame.camera_lead if frame.d_rel is not None else None, drawing.UNCERTAIN, -1.0),
        ):
            if distance is None or not 0.0 < distance < self.road_shown_ahead:
                continue
            ends = self._to_pixels([distance, distance], [0.0, side * LANE_WIDTH])
            drawing.draw_polyline(strip, ends, colour, 1)
            column, row = ends[1].astype(int).tolist()
            cv2.circle(strip, (column, row), 3, colour, cv2.FILLED, cv2.LINE_AA)
            label = f"{name} {distance:.1f} m"
            most_left = self._size[0] - drawing.text_width(label, drawing.SMALL_TEXT)
            label_left = (
                column + 7
                if column + 7 <= most_left
                else column - 7 - drawing.text_width(label, drawing.SMALL_TEXT)
            )
            drawing.write_text(strip, label, (label_left, row + 5), colour, drawing.SMALL_TEXT)

    def _to_pixels(self, x: object, y: object) -> np.ndarray:
        columns = (np.asarray(x, float) + ROAD_SHOWN_BEHIND) * self._pixels_per_metre
        rows = 0.5 * self._size[1] - (np.asarray(y, float) - self._shift) * self._pixels_per_metre
        return np.stack([columns, rows], axis=1)
