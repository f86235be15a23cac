"""Renders a straight road from any position, with the true positions of its lines.

The road is painted once, from above (`road_texture`), and seen through the camera. Each band of rows uses a
copy of suitable coarseness, so that the far road does not flicker.
"""

from dataclasses import dataclass
from math import ceil, cos, floor, sin, tan

import cv2
import numpy as np

from selfdrive.common.array_math import product
from selfdrive.common.camera_model import CameraModel
from selfdrive.common.ordered import total
from selfdrive.sim.lead_picture import draw_car, draw_lead, tint_picture
from selfdrive.sim.road_look import RoadLook, standard_look
from selfdrive.sim.road_texture import RoadStrip, paint_strip

BAND_RATIO = 1.4  # ratio of a band's end to its start, below the horizon
TREE_HEIGHT = 0.05  # of the focal length, above the horizon
MIN_BAND_ROWS = 3  # of the picture in a band
TEXEL_MARGIN = 2  # extra texels for interpolation


@dataclass(frozen=True, slots=True, kw_only=True)
class RowBand:
    """Rows `first`..`last` - 1 of the picture, and the copy of the road that they show.

    Homographies: `to_car` from the band's pixels to the car's frame, `to_texels` from the road to the strip.
    """

    first_row: int
    end_row: int
    texels: np.ndarray
    to_car: np.ndarray
    to_texels: np.ndarray


def first_road_row(model: CameraModel) -> int:
    """The highest row that shows only road."""
    return max(0, ceil(model.horizon + 0.5))


class RoadRenderer:
    """Draws one road with one camera. Equal arguments give equal pictures.

    `look` is the road's appearance, or the marks of the standard look, "solid" or "dashed". The road repeats
    after `periods` dash periods of 12.2 m.
    """

    def __init__(self, model: CameraModel, look: RoadLook | str, seed: int, *, periods: int = 8) -> None:
        self.model = model
        self.look = standard_look(look) if isinstance(look, str) else look
        rng = np.random.default_rng(seed)
        self._bands = _build_bands(model, paint_strip(self.look, periods, rng))
        self._background = _paint_background(model, self.look, rng)

    def render_grey(self, position: float, offset: float = 0.0, heading: float = 0.0) -> np.ndarray:
        """Draw the picture (uint8, rows x width) at `position` m along the road, `offset` m left of the lane
        centre, turned left by `heading` rad."""
        model = self.model
        picture = np.empty((model.rows, model.width), np.uint8)
        self._draw_background(picture, heading)
        to_road = car_to_road(position, offset, heading)
        for band in self._bands:
            _draw_band(picture, band, to_road)
        for car in sorted(self.look.cars, key=lambda car: -car.x):
            draw_car(picture, model, car)
        return picture

    def render_colour(
        self, position: float, offset: float = 0.0, heading: float = 0.0, lead: float | None = None
    ) -> np.ndarray:
        """Draw the picture in colour (uint8, rows x width x BGR) for display, with a car `lead` m ahead."""
        picture = tint_picture(
            self.render_grey(position, offset, heading), self.model, self.look, offset, heading
        )
        if lead is not None:
            draw_lead(picture, self.model, lead, offset, heading)
        return picture

    def true_lines(
        self, offset: float = 0.0, heading: float = 0.0
    ) -> tuple[tuple[float, float], tuple[float, float]]:
        """((y, slope), (y, slope)) of the lane's left and right line in the car's frame, at the car."""
        half, slope = 0.5 * self.look.lane_width, -tan(heading)
        return ((half - offset) / cos(heading), slope), ((-half - offset) / cos(heading), slope)

    def _draw_background(self, picture: np.ndarray, heading: float) -> None:
        rows, width = len(self._background), picture.shape[1]
        spare = self._background.shape[1] - width
        first = min(max(spare // 2 - pan_pixels(self.model, heading), 0), spare)
        picture[:rows] = self._background[:, first : first + width]


def picture_to_car(model: CameraModel, first: int = 0) -> np.ndarray:
    """Homography (3 x 3) from (u, v - `first`, 1) in the picture to (x, y, 1) in the car's frame."""
    fall = model.fy * model.height / cos(model.pitch)
    foot = model.height * tan(model.pitch)
    below = np.array([(1.0, 0.0, 0.0), (0.0, 1.0, first - model.horizon), (0.0, 0.0, 1.0)])
    across = fall / model.fx
    ground = np.array([(0.0, -foot, fall / cos(model.pitch)), (-across, 0.0, across * model.cx), (0, 1, 0)])
    return product(ground, below)


def car_to_road(position: float, offset: float, heading: float) -> np.ndarray:
    """Homography from (x, y, 1) in the car's frame to (along, left of the lane centre, 1) on the road."""
    c, s = cos(heading), sin(heading)
    return np.array([(c, -s, position), (s, c, offset), (0.0, 0.0, 1.0)])


def pan_pixels(model: CameraModel, heading: float) -> int:
    """Shift of distant objects to the right, in pixels, when the car is turned left by `heading` (rad)."""
    return round(model.fx * tan(heading) / cos(model.pitch))


def _build_bands(model: CameraModel, strip: RoadStrip) -> tuple[RowBand, ...]:
    bands = []
    last, top = model.rows, first_road_row(model)
    while last > top:
        below = last - model.horizon
        first = max(top, min(last - MIN_BAND_ROWS, round(model.horizon + below / BAND_RATIO)))
        middle = model.horizon + (below * max(0.5, first - model.horizon)) ** 0.5
        across = model.metres_per_pixel(middle)
        along = model.depth(middle) / ((middle - model.horizon) * cos(model.pitch))
        strip = strip.shrink(max(along, strip.row_length), max(across, strip.column_width))
        bands.append(
            RowBand(
                first_row=first,
                end_row=last,
                texels=strip.texels,
                to_car=picture_to_car(model, first),
                to_texels=strip.road_to_texels(),
            )
        )
        last = first
    return tuple(bands)


def _draw_band(picture: np.ndarray, band: RowBand, to_road: np.ndarray) -> None:
    rows, width = band.end_row - band.first_row, picture.shape[1]
    matrix = product(product(band.to_texels, to_road), band.to_car)
    (columns, lines, scales) = product(matrix, _corners(width, rows)).tolist()
    across = [column / scale for column, scale in zip(columns, scales, strict=True)]
    along = [line / scale for line, scale in zip(lines, scales, strict=True)]
    length, limit = band.texels.shape[0], band.texels.shape[1] - 1
    left = min(max(floor(min(across)) - TEXEL_MARGIN, 0), limit)
    right = min(max(ceil(max(across)) + TEXEL_MARGIN, 0), limit) + 1
    near, far = floor(min(along)) - TEXEL_MARGIN, ceil(max(along)) + TEXEL_MARGIN + 1
    start = near % length
    if start + far - near <= length:
        source = band.texels[start : start + far - near, left:right]
    else:
        source = band.texels[:, left:right].take(np.arange(near, far), axis=0, mode="wrap")
    matrix[0] -= left * matrix[2]
    matrix[1] -= near * matrix[2]
    cv2.warpPerspective(
        source,
        matrix,
        (width, rows),
        dst=picture[band.first_row : band.end_row],
        flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
        borderMode=cv2.BORDER_REPLICATE,
    )


def _corners(width: int, rows: int) -> np.ndarray:
    return np.array([(0, width - 1, 0, width - 1), (0, 0, rows - 1, rows - 1), (1, 1, 1, 1)], float)


def _paint_background(model: CameraModel, look: RoadLook, rng: np.random.Generator) -> np.ndarray:
    rows, width = first_road_row(model), 2 * model.width
    if rows == 0:
        return np.empty((0, width), np.uint8)
    height = np.arange(rows, dtype=np.float32)[:, None] / rows
    sky = look.sky_tone - 35.0 * (1.0 - height) + np.zeros((1, width), np.float32)
    clouds = cv2.resize(
        rng.standard_normal((12, 24), dtype=np.float32), (width, rows), interpolation=cv2.INTER_CUBIC
    )
    sky += 6.0 * clouds
    outline = total(
        cv2.resize(
            rng.standard_normal((1, width // step), dtype=np.float32),
            (width, 1),
            interpolation=cv2.INTER_CUBIC,
        )
        * share
        for step, share in ((160, 0.3), (40, 0.25), (8, 0.12))
    )
    top = model.horizon - TREE_HEIGHT * model.fy * np.clip(0.75 + outline, 0.05, 2.0)
    cover = np.clip(np.arange(rows, dtype=np.float32)[:, None] - top + 0.5, 0.0, 1.0)
    leaves = look.trees_tone + 9.0 * cv2.GaussianBlur(
        rng.standard_normal((rows, width), dtype=np.float32), (0, 0), 1.2
    )
    picture = sky + cover * (leaves - sky)
    return np.clip(look.exposure * picture, 0.0, 255.0).astype(np.uint8)
