"""The road from above: a strip painted once per look, with coarser copies for the distance.

A strip is a cyclic array (rows along the road, columns from left to right) of grey levels.
"""

from dataclasses import dataclass
from math import cos, exp, sin

import cv2
import numpy as np

from selfdrive.common.array_math import each
from selfdrive.common.ordered import total
from selfdrive.sim.road_look import DASH_PERIOD, Look, Paint

HALF_WIDTH = 12.0  # m from the lane centre to the strip's edge
ROWS_PER_PERIOD, COLUMNS = 400, 2400
ROW_LENGTH, COLUMN_WIDTH = DASH_PERIOD / ROWS_PER_PERIOD, 2.0 * HALF_WIDTH / COLUMNS  # m
TILE_PERIODS = 3  # after which the finest texture, which cameras cannot resolve, repeats
TRACK_OFFSET, TRACK_WIDTH = 0.8, 0.35  # m: wheel tracks in a lane
KERB_WIDTH = 0.25  # m
FLAKE_ROWS, FLAKE_COLUMNS = 3, 3  # typical size of a flake
VERGE_GRAIN = 3.0  # coarseness relative to the road


@dataclass(frozen=True, slots=True, kw_only=True)
class Strip:
    """Grey levels of the road from above; `row_length` and `column_width` (m) are the size of a texel."""

    texels: np.ndarray
    row_length: float
    column_width: float

    def shrunk(self, row_length: float, column_width: float) -> "Strip":
        """Return a copy with texels of about this size, each the mean of its area."""
        rows, columns = self.texels.shape
        length, width = rows * self.row_length, columns * self.column_width
        fewer_rows = max(1, min(rows, round(length / row_length)))
        fewer_columns = max(2, min(columns, round(width / column_width)))
        texels = self.texels
        if (fewer_rows, fewer_columns) != texels.shape:
            texels = cv2.resize(texels, (fewer_columns, fewer_rows), interpolation=cv2.INTER_AREA)
        return Strip(texels=texels, row_length=length / fewer_rows, column_width=width / fewer_columns)

    def from_road(self) -> np.ndarray:
        """Homography (3 x 3) from (along, left, 1) on the road in m to (column, row, 1) in texels."""
        return np.array(
            [
                (0.0, -1.0 / self.column_width, HALF_WIDTH / self.column_width - 0.5),
                (1.0 / self.row_length, 0.0, -0.5),
                (0.0, 0.0, 1.0),
            ]
        )


def paint_strip(look: Look, periods: int, rng: np.random.Generator) -> Strip:
    texels = _ground(look, periods, rng)
    _flaws(texels, look, rng)
    for line_y, paint in lines(look):
        if paint is not None:
            _line(texels, line_y, paint, look, rng)
    if look.shadows > 0.0:
        _shade(texels, look, rng)
    if look.exposure != 1.0:
        texels = cv2.convertScaleAbs(texels, alpha=look.exposure)
    return Strip(texels=texels, row_length=ROW_LENGTH, column_width=COLUMN_WIDTH)


def lines(look: Look) -> tuple[tuple[float, Paint | None], ...]:
    """(y, paint) of the road's lines, from left to right."""
    half = 0.5 * look.lane_width
    return (3 * half, look.far_left), (half, look.left), (-half, look.right), (-3 * half, look.far_right)


def _edge(look: Look) -> float:
    return 1.5 * look.lane_width + look.shoulder_width


def _lateral() -> np.ndarray:
    return HALF_WIDTH - (np.arange(COLUMNS) + 0.5) * COLUMN_WIDTH


def _profile(look: Look) -> np.ndarray:
    y = _lateral()
    paved, edge = 1.5 * look.lane_width, _edge(look)
    tone = np.where(np.abs(y) < paved + 0.15, look.asphalt, look.shoulder)
    tone[np.abs(y) > edge] = look.verge
    if look.kerb is not None:
        tone[np.abs(np.abs(y) - edge) < 0.5 * KERB_WIDTH] = look.kerb
    for lane in (-look.lane_width, 0.0, look.lane_width):
        for side in (-TRACK_OFFSET, TRACK_OFFSET):
            tone -= look.tracks * each(exp, -(((y - lane - side) / TRACK_WIDTH) ** 2))
    return tone.astype(np.float32)


def _ground(look: Look, periods: int, rng: np.random.Generator) -> np.ndarray:
    tile_periods = min(TILE_PERIODS, periods)
    fine = rng.standard_normal((tile_periods * ROWS_PER_PERIOD, COLUMNS), dtype=np.float32)
    coarser = np.where(np.abs(_lateral()) > _edge(look), VERGE_GRAIN, 1.0).astype(np.float32)
    fine = _profile(look) + 2.0 * look.grain * coarser * cv2.blur(fine, (2, 2), borderType=cv2.BORDER_REFLECT)
    slow = look.mottle * rng.standard_normal((periods * 6, 24), dtype=np.float32)
    texels = np.empty((periods * ROWS_PER_PERIOD, COLUMNS), np.uint8)
    for k in range(periods):
        tile = k % tile_periods * ROWS_PER_PERIOD
        tones = fine[tile : tile + ROWS_PER_PERIOD] + _enlarged(slow, k, periods)
        texels[k * ROWS_PER_PERIOD : (k + 1) * ROWS_PER_PERIOD] = np.clip(tones, 0.0, 255.0)
    return texels


def _flaws(texels: np.ndarray, look: Look, rng: np.random.Generator) -> None:
    rows, length = len(texels), len(texels) * ROW_LENGTH
    paved = 1.5 * look.lane_width
    for _ in range(rng.poisson(look.patches * length / 100.0)):
        long, wide = rng.uniform(0.8, 8.0), rng.uniform(0.5, 2.6)
        row, y = rng.integers(rows), rng.uniform(-paved, paved)
        part = texels[row : row + int(long / ROW_LENGTH), _column(y + wide) : _column(y)]
        part[:] = cv2.add(part, look.joint_tone * rng.uniform(-0.3, 0.5))
    tone = max(0.0, look.asphalt + look.joint_tone)
    for _ in range(rng.poisson(look.cracks * length / 100.0)):
        _polyline(texels, rng, tone, length=rng.uniform(1.0, 6.0), heading=rng.uniform(0.0, 2.0 * np.pi))
    for _ in range(rng.poisson(look.seams * length / 100.0)):
        _polyline(texels, rng, tone, length=rng.uniform(10.0, 60.0), heading=rng.normal(0.0, 0.01))
    if look.joints is not None:
        for x in np.arange(0.0, length, look.joints):
            row = int(x / ROW_LENGTH)
            part = texels[row : row + 1, _column(paved) : _column(-paved)]
            part[:] = cv2.add(part, look.joint_tone)


def _polyline(
    texels: np.ndarray, rng: np.random.Generator, tone: float, *, length: float, heading: float
) -> None:
    steps = max(3, int(length / 0.4))
    turns = heading + np.cumsum(rng.normal(0.0, 0.25 if length < 10.0 else 0.004, steps))
    x = rng.uniform(0.0, len(texels) * ROW_LENGTH) + np.cumsum(0.4 * each(cos, turns))
    y = rng.uniform(-6.0, 6.0) + np.cumsum(0.4 * each(sin, turns))
    points = np.stack([(HALF_WIDTH - y) / COLUMN_WIDTH, x / ROW_LENGTH], axis=1)
    thickness = int(rng.integers(1, 4))
    cv2.polylines(texels, [points.astype(np.int32)], False, tone, thickness, cv2.LINE_AA)


def _line(texels: np.ndarray, y: float, paint: Paint, look: Look, rng: np.random.Generator) -> None:
    centres = (y - paint.width, y + paint.width) if paint.double else (y,)
    first, last = _column(max(centres) + paint.width), _column(min(centres) - paint.width) + 1
    across = total(
        np.clip((0.5 * paint.width - np.abs(_lateral()[first:last] - centre)) / COLUMN_WIDTH + 0.5, 0.0, 1.0)
        for centre in centres
    )
    along = _dashes(len(texels), paint)
    cover = (1.0 - paint.fade) * along[:, None] * np.asarray(across)[None, :]
    if paint.wear > 0.0:
        cover *= 1.0 - 0.85 * _flakes(cover.shape, paint.wear, rng)
    part = texels[:, first:last]
    part[:] = np.clip(part + cover * (paint.tone - part.astype(np.float32)), 0.0, 255.0)


def _dashes(rows: int, paint: Paint) -> np.ndarray:
    if not paint.dashed:
        return np.ones(rows, np.float32)
    edges = np.arange(rows + 1) * ROW_LENGTH - paint.phase
    whole, rest = np.divmod(edges, paint.period)
    painted = whole * paint.dash + np.minimum(rest, paint.dash)  # length painted up to each edge
    return (np.diff(painted) / ROW_LENGTH).astype(np.float32)


def _flakes(shape: tuple[int, int], share: float, rng: np.random.Generator) -> np.ndarray:
    """1 where paint has come off (`share` of the area), 0 elsewhere, with soft edges."""
    rows, columns = shape
    spots = rng.standard_normal((rows // FLAKE_ROWS + 2, columns // FLAKE_COLUMNS + 2), dtype=np.float32)
    spots = cv2.resize(cv2.GaussianBlur(spots, (0, 0), 0.8), (columns, rows))
    limit = np.quantile(spots[:: max(1, rows // 2000)], 1.0 - share)
    return np.clip((spots - limit) * 12.0 + 0.5, 0.0, 1.0)


def _shade(texels: np.ndarray, look: Look, rng: np.random.Generator) -> None:
    rows = len(texels)
    small = (max(8, int(rows * ROW_LENGTH / 0.6)), int(2.0 * HALF_WIDTH / 0.6))
    noise = rng.standard_normal(small, dtype=np.float32)
    noise = cv2.GaussianBlur(np.concatenate([noise] * 3), (0, 0), 2.2)
    noise += 0.25 * cv2.GaussianBlur(rng.standard_normal(noise.shape, dtype=np.float32), (0, 0), 0.7)
    noise = noise[small[0] : 2 * small[0]]
    limit = np.quantile(noise, 1.0 - look.shadows)
    # Beyond the strip its edge is repeated, so shadows must not reach the edge.
    depth = look.shadow_depth * np.clip(HALF_WIDTH - 0.5 - np.abs(_lateral()), 0.0, 1.0).astype(np.float32)
    for k in range(rows // ROWS_PER_PERIOD):
        part = texels[k * ROWS_PER_PERIOD : (k + 1) * ROWS_PER_PERIOD]
        shade = _enlarged(noise, k, rows // ROWS_PER_PERIOD)
        part[:] = part * (1.0 - depth * np.clip((shade - limit) * 12.0, 0.0, 1.0))


def _enlarged(coarse: np.ndarray, k: int, periods: int) -> np.ndarray:
    down, across = len(coarse) / (periods * ROWS_PER_PERIOD), coarse.shape[1] / COLUMNS
    matrix = np.array(
        [[across, 0.0, 0.5 * across - 0.5], [0.0, down, down * (k * ROWS_PER_PERIOD + 0.5) - 0.5]]
    )
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    size = (COLUMNS, ROWS_PER_PERIOD)
    return cv2.warpAffine(coarse, matrix, size, flags=flags, borderMode=cv2.BORDER_WRAP)


def _column(y: float) -> int:
    return min(max(int((HALF_WIDTH - y) / COLUMN_WIDTH), 0), COLUMNS - 1)
