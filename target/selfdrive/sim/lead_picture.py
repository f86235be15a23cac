"""Draws vehicles into pictures and tints pictures, for display and to test detectors."""

from math import cos, floor, sin, tan

import cv2
import numpy as np

from selfdrive.common.camera_model import CameraModel
from selfdrive.sim.road_look import OtherCar, RoadLook

CAR_LENGTH = 4.4  # m of a car
CAMERA_TO_BUMPER = 1.5  # m from the camera to the front bumper, from which the lead's distance is measured
CAR_HEIGHT = 1.55  # m; at least that of the lead
LEAST_DEPTH = 0.3  # m along the optical axis; closer points have no sensible place in a picture
FARTHEST_DRAWN = 400.0  # m ahead
ROOF_DRAWN_BELOW = 4.0  # m ahead; pictures of cars farther away show no roof
FRACTION_BITS = 4  # fractional bits of OpenCV's coordinates

LEAD_PAINT = (70.0, 45.0, 130.0)  # BGR, a dark red
SKY_TINT, ROAD_TINT, VERGE_TINT = (
    (1.10, 1.0, 0.97),
    (1.02, 1.0, 0.99),
    (0.66, 1.10, 0.93),
)  # BGR, same grey level
YELLOW_TINT = (0.40, 1.04, 1.15)

Tone = float | tuple[float, float, float]


def draw_car(picture: np.ndarray, model: CameraModel, car: OtherCar) -> None:
    tone = car.tone
    _draw_vehicle(picture, model, car, (tone, 0.75 * tone, 0.4 * tone + 20.0, min(255.0, tone + 70.0), 24.0))


def draw_lead(picture: np.ndarray, model: CameraModel, lead: float, offset: float, heading: float) -> None:
    """Draw a car into a BGR picture, in the lane centre, with its rear `lead` m ahead of the front bumper."""
    ahead = lead + CAMERA_TO_BUMPER
    car = OtherCar(
        x=ahead * cos(heading) - offset * sin(heading), y=-offset * cos(heading) - ahead * sin(heading)
    )
    if ahead > FARTHEST_DRAWN or not is_before_camera(model, car.x):
        return
    side = tuple(0.7 * part for part in LEAD_PAINT)
    _draw_vehicle(
        picture, model, car, (LEAD_PAINT, side, (70.0, 62.0, 55.0), (40.0, 40.0, 230.0), (24.0, 24.0, 24.0))
    )
    if ahead < ROOF_DRAWN_BELOW and model.height > car.height:
        _draw_roof(picture, model, car, tuple(0.85 * part for part in LEAD_PAINT))


def is_before_camera(model: CameraModel, ahead: float) -> bool:
    """Whether all of a car can be projected whose rear is `ahead` m from the camera."""
    return all(
        ahead * cos(model.pitch) + (model.height - z) * sin(model.pitch) >= LEAST_DEPTH
        for z in (0.0, CAR_HEIGHT)
    )


def tint_picture(
    grey: np.ndarray, model: CameraModel, look: RoadLook, offset: float = 0.0, heading: float = 0.0
) -> np.ndarray:
    """Tint a grey picture in the colours of sky, verge and paint; grey levels stay the same."""
    tints = [SKY_TINT, VERGE_TINT, ROAD_TINT, YELLOW_TINT]
    levels = np.arange(256, dtype=np.float32)
    colours = np.clip(levels[:, None] * np.array(tints, np.float32)[:, None], 0.0, 255.0).astype(np.uint8)
    worn = levels <= look.exposure * (0.6 * look.asphalt_tone + 0.4 * 182.0)  # where paint is worn off
    colours[3, worn] = colours[2, worn]
    parts = np.zeros(grey.shape, np.uint8)  # the tint of each pixel
    parts[max(0, floor(model.horizon) + 1) :] = 1
    half = 0.5 * look.lane_width
    edge = 3.0 * half + look.shoulder_width
    _mark_strip(parts, model, (-edge - offset, edge - offset), heading, 2)
    for y, paint in ((half, look.left), (-half, look.right)):
        if paint.yellow:
            _mark_strip(parts, model, (y - offset - 0.4, y - offset + 0.4), heading, 3)
    return colours.reshape(-1, 3).take(parts.astype(np.uint16) << 8 | grey, axis=0)


def _mark_strip(
    parts: np.ndarray, model: CameraModel, sides: tuple[float, float], heading: float, part: int
) -> None:
    rows = (max(0, floor(model.horizon) + 1), model.rows - 1)
    ends = []
    for y in sides:
        a, b = model.line_in_picture(y / cos(heading), -tan(heading))
        ends.append([(a * row + b, row) for row in rows])
    cv2.fillConvexPoly(parts, _to_fixed_point([*ends[0], *ends[1][::-1]]), part, cv2.LINE_8, FRACTION_BITS)


def _draw_vehicle(picture: np.ndarray, model: CameraModel, car: OtherCar, tones: tuple[Tone, ...]) -> None:
    """Draw a box with window, lights and wheels. `tones`: body, side, glass, lights, dark parts."""
    body, flank, glass, lamps, dark = tones
    left, right, near, far = car.y + 0.5 * car.width, car.y - 0.5 * car.width, car.x, car.x + CAR_LENGTH
    waist, floor_z = 0.62 * car.height, 0.17 * car.height

    def fill(corners: list[tuple[float, float, float]], tone: Tone) -> None:
        _fill_polygon(picture, [model.project(*corner) for corner in corners], tone)

    def back(y1: float, y2: float, z1: float, z2: float, tone: Tone) -> None:
        fill([(near, y1, z2), (near, y2, z2), (near, y2, z1), (near, y1, z1)], tone)

    fill([(near, left, 0.0), (near, right, 0.0), (far, right, 0.0), (far, left, 0.0)], dark)
    if right > 0.0 or left < 0.0:  # beside the camera: its side is visible
        y, roof = (right, right + 0.2) if right > 0.0 else (left, left - 0.2)
        fill([(near, y, waist), (far, y, waist), (far, y, floor_z), (near, y, floor_z)], flank)
        top = [(near + 0.5, roof, car.height), (far - 1.5, roof, car.height)]
        fill([*top, (far - 0.7, y, waist), (near, y, waist)], glass)
    for inner, outer in ((left - 0.24, left), (right + 0.24, right)):
        back(outer, inner, 0.0, 1.2 * floor_z, dark)
    back(left, right, floor_z, waist, body)
    roof = [(near + 0.5, left - 0.2, car.height), (near + 0.5, right + 0.2, car.height)]
    fill([*roof, (near, right, waist), (near, left, waist)], body)
    inset = [(near + 0.42, left - 0.28, 0.95 * car.height), (near + 0.42, right + 0.28, 0.95 * car.height)]
    fill([*inset, (near, right + 0.15, waist), (near, left - 0.15, waist)], glass)
    for inner, outer in ((left - 0.26, left), (right + 0.26, right)):
        back(outer, inner, 0.75 * waist, 0.95 * waist, lamps)


def _draw_roof(picture: np.ndarray, model: CameraModel, car: OtherCar, tone: Tone) -> None:
    """Draw the roof of a car near the camera, which must be above it."""
    near, far, half = car.x + 0.5, car.x + CAR_LENGTH - 1.5, 0.5 * car.width - 0.2
    corners = [(near, half), (near, -half), (far, -half), (far, half)]
    _fill_polygon(picture, [model.project(x, car.y + y, car.height) for x, y in corners], tone)


def _fill_polygon(picture: np.ndarray, points: list[tuple[float, float]], tone: Tone) -> None:
    cv2.fillConvexPoly(picture, _to_fixed_point(points), tone, cv2.LINE_AA, FRACTION_BITS)


def _to_fixed_point(points: list[tuple[float, float]]) -> np.ndarray:
    return np.round(np.array(points) * 2**FRACTION_BITS).clip(-(2**20), 2**20).astype(np.int32)
