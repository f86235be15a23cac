"""The road from above: a strip painted once per look, with coarser copies for the distance.

A strip is a cyclic array (rows along the road, columns from left to right) of grey levels.
"""

from dataclasses import dataclass
from math import cos, exp, sin

import cv2
import numpy as np

from selfdrive.common.array_math import each
from selfdrive.common.ordered import total
from selfdrive.sim.road_look import DASH_PERIOD, LinePaint, RoadLook

STRIP_HALF_WIDTH = 12.0  # m from the lane centre to the strip's edge
ROWS_PER_PERIOD, COLUMNS = 400, 2400  # texels of 3 cm along the road and 1 cm across
ROW_LENGTH, COLUMN_WIDTH = DASH_PERIOD / ROWS_PER_PERIOD, 2.0 * STRIP_HALF_WIDTH / COLUMNS  # m
FINE_TEXTURE_REPEAT_PERIODS = 3  # after which the finest texture, which cameras cannot resolve, repeats
TRACK_OFFSET, TRACK_WIDTH = 0.8, 0.35  # m: wheel tracks in a lane
KERB_WIDTH = 0.25  # m
FLAKE_ROWS, FLAKE_COLUMNS = 3, 3  # typical size of a flake
VERGE_GRAIN_RATIO = 3.0  # coarseness relative to the road


@dataclass(frozen=True, slots=True, kw_only=True)
class RoadStrip:
    """Grey levels of the road from above; `row_length` and `column_width` (m) are the size of a texel."""

    texels: np.ndarray
    row_length: float
    column_width: float

    def shrink(self, row_length: float, column_width: float) -> "RoadStrip":
        """Return a copy with texels of about this size, each the mean of its area."""
        rows, columns = self.texels.shape
        length, width = rows * self.row_length, columns * self.column_width
        fewer_rows = max(1, min(rows, round(length / row_length)))
        fewer_columns = max(2, min(columns, round(width / column_width)))
        texels = self.texels
        if (fewer_rows, fewer_columns) != texels.shape:
            texels = cv2.resize(texels, (fewer_columns, fewer_rows), interpolation=cv2.INTER_AREA)
        return RoadStrip(texels=texels, row_length=length / fewer_rows, column_width=width / fewer_columns)

    def road_to_texels(self) -> np.ndarray:
        """Homography (3 x 3) from (along, left, 1) on the road in m to (column, row, 1) in texels."""
        return np.array(
            [
                (0.0, -1.0 / self.column_width, STRIP_HALF_WIDTH / self.column_width - 0.5),
                (1.0 / self.row_length, 0.0, -0.5),
                (0.0, 0.0, 1.0),
            ]
        )


def paint_strip(look: RoadLook, periods: int, rng: np.random.Generator) -> RoadStrip:
    texels = _paint_ground(look, periods, rng)
    _add_patches_and_cracks(texels, look, rng)
    for line_y, paint in road_lines(look):
        if paint is not None:
            _paint_line(texels, line_y, paint, look, rng)
    if look.shadow_share > 0.0:
        _add_tree_shadows(texels, look, rng)
    if look.exposure != 1.0:
        texels = cv2.convertScaleAbs(texels, alpha=look.exposure)
    return RoadStrip(texels=texels, row_length=ROW_LENGTH, column_width=COLUMN_WIDTH)


def road_lines(look: RoadLook) -> tuple[tuple[float, LinePaint | None], ...]:
    """(y, paint) of the road's lines, from left to right."""
    half = 0.5 * look.lane_width
    return (3 * half, look.far_left), (half, look.left), (-half, look.right), (-3 * half, look.far_right)


def _verge_start(look: RoadLook) -> float:
    return 1.5 * look.lane_width + look.shoulder_width


def _column_positions() -> np.ndarray:
    return STRIP_HALF_WIDTH - (np.arange(COLUMNS) + 0.5) * COLUMN_WIDTH


def _cross_profile(look: RoadLook) -> np.ndarray:
    y = _column_positions()
    paved, edge = 1.5 * look.lane_width, _verge_start(look)
    tone = np.where(np.abs(y) < paved + 0.15, look.asphalt_tone, look.shoulder_tone)
    tone[np.abs(y) > edge] = look.verge_tone
    if look.kerb_tone is not None:
        tone[np.abs(np.abs(y) - edge) < 0.5 * KERB_WIDTH] = look.kerb_tone
    for lane in (-look.lane_width, 0.0, look.lane_width):
        for side in (-TRACK_OFFSET, TRACK_OFFSET):
            tone -= look.wheel_track_darkening * each(exp, -(((y - lane - side) / TRACK_WIDTH) ** 2))
    return tone.astype(np.float32)


def _paint_ground(look: RoadLook, periods: int, rng: np.random.Generator) -> np.ndarray:
    tile_periods = min(FINE_TEXTURE_REPEAT_PERIODS, periods)
    fine = rng.standard_normal((tile_periods * ROWS_PER_PERIOD, COLUMNS), dtype=np.float32)
    coarser = np.where(np.abs(_column_positions()) > _verge_start(look), VERGE_GRAIN_RATIO, 1.0).astype(
        np.float32
    )
    fine = _cross_profile(look) + 2.0 * look.grain * coarser * cv2.blur(
        fine, (2, 2), borderType=cv2.BORDER_REFLECT
    )
    slow = look.mottle * rng.standard_normal((periods * 6, 24), dtype=np.float32)
    texels = np.empty((periods * ROWS_PER_PERIOD, COLUMNS), np.uint8)
    for k in range(periods):
        tile = k % tile_periods * ROWS_PER_PERIOD
        tones = fine[tile : tile + ROWS_PER_PERIOD] + _enlarge_for_period(slow, k, periods)
        texels[k * ROWS_PER_PERIOD : (k + 1) * ROWS_PER_PERIOD] = np.clip(tones, 0.0, 255.0)
    return texels


def _add_patches_and_cracks(texels: np.ndarray, look: RoadLook, rng: np.random.Generator) -> None:
    rows, length = len(texels), len(texels) * ROW_LENGTH
    paved = 1.5 * look.lane_width
    for _ in range(rng.poisson(look.patches_per_100_m * length / 100.0)):
        long, wide = rng.uniform(0.8, 8.0), rng.uniform(0.5, 2.6)
        row, y = rng.integers(rows), rng.uniform(-paved, paved)
        part = texels[row : row + int(long / ROW_LENGTH), _column_of(y + wide) : _column_of(y)]
        part[:] = cv2.add(part, look.joint_tone * rng.uniform(-0.3, 0.5))
    tone = max(0.0, look.asphalt_tone + look.joint_tone)
    for _ in range(rng.poisson(look.cracks_per_100_m * length / 100.0)):
        _draw_crack(texels, rng, tone, length=rng.uniform(1.0, 6.0), heading=rng.uniform(0.0, 2.0 * np.pi))
    for _ in range(rng.poisson(look.seams_per_100_m * length / 100.0)):
        _draw_crack(texels, rng, tone, length=rng.uniform(10.0, 60.0), heading=rng.normal(0.0, 0.01))
    if look.joint_spacing is not None:
        for x in np.arange(0.0, length, look.joint_spacing):
            row = int(x / ROW_LENGTH)
            part = texels[row : row + 1, _column_of(paved) : _column_of(-paved)]
            part[:] = cv2.add(part, look.joint_tone)


def _draw_crack(
    texels: np.ndarray, rng: np.random.Generator, tone: float, *, length: float, heading: float
) -> None:
    steps = max(3, int(length / 0.4))
    turns = heading + np.cumsum(rng.normal(0.0, 0.25 if length < 10.0 else 0.004, steps))
    x = rng.uniform(0.0, len(texels) * ROW_LENGTH) + np.cumsum(0.4 * each(cos, turns))
    y = rng.uniform(-6.0, 6.0) + np.cumsum(0.4 * each(sin, turns))
    points = np.stack([(STRIP_HALF_WIDTH - y) / COLUMN_WIDTH, x / ROW_LENGTH], axis=1)
    thickness = int(rng.integers(1, 4))
    cv2.polylines(texels, [points.astype(np.int32)], False, tone, thickness, cv2.LINE_AA)


def _paint_line(
    texels: np.ndarray, y: float, paint: LinePaint, look: RoadLook, rng: np.random.Generator
) -> None:
    centres = (y - paint.width, y + paint.width) if paint.double else (y,)
    first, last = _column_of(max(centres) + paint.width), _column_of(min(centres) - paint.width) + 1
    across = total(
        np.clip(
            (0.5 * paint.width - np.abs(_column_positions()[first:last] - centre)) / COLUMN_WIDTH + 0.5,
            0.0,
            1.0,
        )
        for centre in centres
    )
    along = _painted_share(len(texels), paint)
    cover = (1.0 - paint.fade) * along[:, None] * np.asarray(across)[None, :]
    if paint.wear > 0.0:
        cover *= 1.0 - 0.85 * _flaked_share(cover.shape, paint.wear, rng)
    part = texels[:, first:last]
    part[:] = np.clip(part + cover * (paint.tone - part.astype(np.float32)), 0.0, 255.0)


def _painted_share(rows: int, paint: LinePaint) -> np.ndarray:
    if not paint.dashed:
        return np.ones(rows, np.float32)
    edges = np.arange(rows + 1) * ROW_LENGTH - paint.phase
    whole, rest = np.divmod(edges, paint.period)
    painted = whole * paint.dash + np.minimum(rest, paint.dash)  # length painted up to each edge
    return (np.diff(painted) / ROW_LENGTH).astype(np.float32)


def _flaked_share(shape: tuple[int, int], share: float, rng: np.random.Generator) -> np.ndarray:
    """1 where paint has come off (`share` of the area), 0 elsewhere, with soft edges."""
    rows, columns = shape
    spots = rng.standard_normal((rows // FLAKE_ROWS + 2, columns // FLAKE_COLUMNS + 2), dtype=np.float32)
    spots = cv2.resize(cv2.GaussianBlur(spots, (0, 0), 0.8), (columns, rows))
    limit = np.quantile(spots[:: max(1, rows // 2000)], 1.0 - share)
    return np.clip((spots - limit) * 12.0 + 0.5, 0.0, 1.0)


def _add_tree_shadows(texels: np.ndarray, look: RoadLook, rng: np.random.Generator) -> None:
    rows = len(texels)
    small = (max(8, int(rows * ROW_LENGTH / 0.6)), int(2.0 * STRIP_HALF_WIDTH / 0.6))
    noise = rng.standard_normal(small, dtype=np.float32)
    noise = cv2.GaussianBlur(np.concatenate([noise] * 3), (0, 0), 2.2)
    noise += 0.25 * cv2.GaussianBlur(rng.standard_normal(noise.shape, dtype=np.float32), (0, 0), 0.7)
    noise = noise[small[0] : 2 * small[0]]
    limit = np.quantile(noise, 1.0 - look.shadow_share)
    # Beyond the strip its edge is repeated, so shadows must not reach the edge.
    depth = look.shadow_depth * np.clip(
        STRIP_HALF_WIDTH - 0.5 - np.abs(_column_positions()), 0.0, 1.0
    ).astype(np.float32)
    for k in range(rows // ROWS_PER_PERIOD):
        part = texels[k * ROWS_PER_PERIOD : (k + 1) * ROWS_PER_PERIOD]
        shade = _enlarge_for_period(noise, k, rows // ROWS_PER_PERIOD)
        part[:] = part * (1.0 - depth * np.clip((shade - limit) * 12.0, 0.0, 1.0))


def _enlarge_for_period(coarse: np.ndarray, k: int, periods: int) -> np.ndarray:
    down, across = len(coarse) / (periods * ROWS_PER_PERIOD), coarse.shape[1] / COLUMNS
    matrix = np.array(
        [[across, 0.0, 0.5 * across - 0.5], [0.0, down, down * (k * ROWS_PER_PERIOD + 0.5) - 0.5]]
    )
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    size = (COLUMNS, ROWS_PER_PERIOD)
    return cv2.warpAffine(coarse, matrix, size, flags=flags, borderMode=cv2.BORDER_WRAP)


def _column_of(y: float) -> int:
    return min(max(int((STRIP_HALF_WIDTH - y) / COLUMN_WIDTH), 0), COLUMNS - 1)
