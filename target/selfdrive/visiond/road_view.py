"""The picture as a map of the road: rows by distance ahead, columns by lateral position.

In the map, every lane mark has the same width, and a line along the car's heading is vertical. Near rows come
from a reduced picture, whose pixels are means, so no detail is skipped.
"""

import cv2
import numpy as np

from selfdrive.common.camera_model import CameraModel
from selfdrive.common.errors import ConfigError

CELL_WIDTH = 0.04  # m, a column of the map
SIDE_REACH = 5.2  # m, to the left and to the right
MIN_RESOLUTION = 1.3 / 0.12  # px/m; with fewer, a mark of 0.12 m looks like texture
FARTHEST_ROAD = 35.0  # m
MIN_DROP = 13.0  # px below the horizon, more than a camera's pitch can be off
MIN_ROWS = 8  # fewer would not show a line's direction
LEVEL_COUNT = 3  # full, half and quarter size
HALVING_RESOLUTION = 40.0  # px/m above which the next smaller picture is used


class RoadView:
    """Maps pictures of one camera.

    Per row of the map, nearest last: `drop` (px below the horizon), `scale` (px of the picture per m of road)
    and `share` (number of picture rows that it represents). `y` (m, left positive) per column, largest first.
    Raises ConfigError if the camera sees too little of the road.
    """

    def __init__(self, model: CameraModel) -> None:
        self.y = np.arange(SIDE_REACH, -SIDE_REACH, -CELL_WIDTH, dtype=np.float32)
        rows_by_level = [(level, rows) for level in range(LEVEL_COUNT) if (rows := _rows_of(model, level))]
        rows = [row for _, of_level in rows_by_level for row in of_level]
        shares = [2.0**level for level, of_level in rows_by_level for _ in of_level]
        if len(rows) < MIN_ROWS:
            raise ConfigError(
                f"{len(rows)} rows in which marks are wide enough, up to {FARTHEST_ROAD:.0f} m ahead",
                where="the camera's calibration",
                expected=f"at least {MIN_ROWS}",
                remedy="use larger pictures, or a camera that sees the road before the car",
            )
        # The first row used; a row of every level begins here.
        self._first = int(min(rows)) >> LEVEL_COUNT << LEVEL_COUNT
        self._levels = [
            _remap_tables(model, of_level, self.y, level, self._first) for level, of_level in rows_by_level
        ]
        self.drop = np.array(rows, np.float32) - np.float32(model.horizon)
        self.scale = np.array([1.0 / model.metres_per_pixel(row) for row in rows], np.float32)
        self.share = np.array(shares, np.float32)

    def map_picture(self, picture: np.ndarray) -> np.ndarray:
        """Return the map (uint8, rows x columns) of a grey picture (uint8)."""
        picture = np.asarray(picture[self._first :, :])
        parts = []
        for level, (columns, rows) in enumerate(self._levels):
            if level:
                picture = cv2.resize(picture, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
            parts.append(cv2.remap(picture, columns, rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE))
        return np.concatenate(parts)

    def rows_with_content(self, road: np.ndarray) -> float:
        """Number of picture rows represented by the map's rows that are not uniform."""
        return float(self.share[road.max(axis=1) > road.min(axis=1)].sum())


def _rows_of(model: CameraModel, level: int) -> list[float]:
    step = 2**level
    finest = HALVING_RESOLUTION * step / 2 if level else 0.0
    coarsest = HALVING_RESOLUTION * step if level < LEVEL_COUNT - 1 else np.inf
    rows = [step * (row + 0.5) - 0.5 for row in range(model.rows // step)]
    return [
        row
        for row in rows
        if row > model.horizon + MIN_DROP
        and model.distance(row) < FARTHEST_ROAD
        and max(finest, MIN_RESOLUTION) <= 1.0 / model.metres_per_pixel(row) < coarsest
    ]


def _remap_tables(
    model: CameraModel, rows: list[float], y: np.ndarray, level: int, first: int
) -> tuple[np.ndarray, np.ndarray]:
    """Columns and rows in the level's picture (from row `first`) for each point of the map."""
    scale = np.array([1.0 / model.metres_per_pixel(row) for row in rows])
    columns = model.cx - scale[:, None] * y
    row_grid = np.broadcast_to(np.array(rows)[:, None] - first, columns.shape)
    small = [((full + 0.5) / 2**level - 0.5).astype(np.float32) for full in (columns, row_grid)]
    return cv2.convertMaps(small[0], small[1], cv2.CV_16SC2)
