"""The road from above, driving to the right: car and lead, and what the controller sees."""

from math import copysign, cos, sin

import cv2
import numpy as np

from selfdrive.sim.camera import LANE_WIDTH
from selfdrive.sim.film import drawing
from selfdrive.sim.film.film_recorder import KNOTS
from selfdrive.sim.film.recorded_film import Frame
from selfdrive.sim.hazards import CAR_WIDTH
from selfdrive.sim.lead_picture import LENGTH

ROAD = (84, 78, 74)
PAINT = (205, 205, 205)
YELLOW = (70, 180, 215)
VERGE = (52, 66, 50)
LEAD_BODY = (92, 78, 168)
BEHIND = 8.0  # m of road shown behind the car's front
SHOULDER = 0.7  # m
DASH, PERIOD = 3.05, 12.2  # m; of the outer lines, which show the motion
LINE_WIDTH, FAR_LINE_WIDTH = 2, 1  # pixels


class BirdsEye:
    """Draws frames into strips of `width` x `height` pixels with three lanes; the car has `colour`."""

    def __init__(self, width: int, height: int, colour: drawing.Colour) -> None:
        self._size, self._colour = (width, height), colour
        self._shift = 0.0  # m, shift of the strip to follow a car that leaves the road
        self._scale = height / (3.0 * LANE_WIDTH + 2.0 * (SHOULDER + 0.3))
        self.ahead = width / self._scale - BEHIND  # m shown

    def draw(self, frame: Frame) -> np.ndarray:
        self._shift = copysign(max(0.0, abs(frame.offset) - LANE_WIDTH), frame.offset)
        strip = np.full((self._size[1], self._size[0], 3), VERGE, np.uint8)
        self._draw_road(strip, frame.position)
        self._draw_seen(strip, frame)
        if frame.d_rel is not None:
            self._draw_car(strip, frame.d_rel + LENGTH, 0.0, 0.0, LEAD_BODY)
        self._draw_car(strip, 0.0, frame.offset, frame.heading, self._colour)
        self._draw_distances(strip, frame)
        return strip

    def _draw_road(self, strip: np.ndarray, position: float) -> None:
        edge = 1.5 * LANE_WIDTH + SHOULDER
        ends = np.array([-BEHIND, self.ahead])
        drawing.fill(strip, self._places([*ends, *ends[::-1]], [edge, edge, -edge, -edge]), ROAD)
        half = 0.5 * LANE_WIDTH
        for y, colour in ((half, YELLOW), (-half, PAINT)):
            drawing.stroke(strip, self._places(ends, [y, y]), colour, LINE_WIDTH)
        first = -((position - BEHIND) % PERIOD) - BEHIND
        for y in (3.0 * half, -3.0 * half):
            for start in np.arange(first, self.ahead, PERIOD):
                drawing.stroke(strip, self._places([start, start + DASH], [y, y]), PAINT, FAR_LINE_WIDTH)

    def _draw_seen(self, strip: np.ndarray, frame: Frame) -> None:
        seen = [line for line in (frame.lines or {}).values() if line.drawable]
        lines = [(line.y, drawing.line_colour(line.prob), LINE_WIDTH) for line in seen]
        if np.isfinite(frame.plan).all():
            lines.append((frame.plan, drawing.PATH, 1))
        for y, colour, thickness in lines:
            places = self._places(KNOTS, np.array(y) - frame.bend - frame.middle)
            drawing.stroke(strip, places, colour, thickness)

    def _draw_car(
        self, strip: np.ndarray, front: float, offset: float, heading: float, colour: drawing.Colour
    ) -> None:
        for x, y, tone in (
            ([0.0, 0.0, -LENGTH, -LENGTH], 1.0, colour),
            ([-1.2, -1.2, -1.9, -1.9], 0.8, drawing.PAPER),
        ):
            along = np.array(x)
            across = 0.5 * CAR_WIDTH * y * np.array([1.0, -1.0, -1.0, 1.0])
            c, s = cos(heading), sin(heading)
            drawing.fill(
                strip, self._places(front + along * c - across * s, offset + along * s + across * c), tone
            )

    def _draw_distances(self, strip: np.ndarray, frame: Frame) -> None:
        for name, distance, colour, side in (
            ("radar", frame.radar, drawing.FAULTY, 1.0),
            ("camera", frame.camera_lead if frame.d_rel is not None else None, drawing.DOUBTED, -1.0),
        ):
            if distance is None or not 0.0 < distance < self.ahead:
                continue
            ends = self._places([distance, distance], [0.0, side * LANE_WIDTH])
            drawing.stroke(strip, ends, colour, 1)
            column, row = ends[1].astype(int).tolist()
            cv2.circle(strip, (column, row), 3, colour, cv2.FILLED, cv2.LINE_AA)
            words = f"{name} {distance:.1f} m"
            room = self._size[0] - drawing.width(words, drawing.SMALL)
            left = column + 7 if column + 7 <= room else column - 7 - drawing.width(words, drawing.SMALL)
            drawing.write(strip, words, (left, row + 5), colour, drawing.SMALL)

    def _places(self, x: object, y: object) -> np.ndarray:
        columns = (np.asarray(x, float) + BEHIND) * self._scale
        rows = 0.5 * self._size[1] - (np.asarray(y, float) - self._shift) * self._scale
        return np.stack([columns, rows], axis=1)
