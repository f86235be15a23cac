"""The map of the road in compiled C, if available: the same map to the bit."""

import ctypes
from pathlib import Path

import numpy as np

from selfdrive.common import compiled
from selfdrive.common.camera_model import CameraModel
from selfdrive.visiond.road_view import LEVEL_COUNT, RoadView

C_SOURCE = Path(__file__).with_name("road_view.c")
SPARE_PIXELS = 4  # pixels past the end of a picture that C can read


class _LevelStructure(ctypes.Structure):
    _fields_ = (("rows", ctypes.c_int64), ("first", ctypes.c_int64), ("places", ctypes.c_void_p))


class _ViewStructure(ctypes.Structure):
    _fields_ = (
        *((name, ctypes.c_int64) for name in ("rows", "width", "columns")),
        ("levels", _LevelStructure * LEVEL_COUNT),
        ("smaller", ctypes.c_void_p * (LEVEL_COUNT - 1)),
        ("road", ctypes.c_void_p),
    )


class CompiledRoadView(RoadView):
    """RoadView that calls the compiled `road_view.c`."""

    def __init__(self, model: CameraModel, library: compiled.Library) -> None:
        super().__init__(model)
        self._take_map = library.code.take_map
        self._take_map.argtypes, self._take_map.restype = [ctypes.c_void_p] * 2, None
        rows, width = self._shape = model.rows - self._first, model.width
        self._even = len(self._levels) == LEVEL_COUNT and not (rows | width) % 2 ** (LEVEL_COUNT - 1)
        self._road = np.empty((len(self.drop), len(self.y)), np.uint8)
        if not self._even:
            return
        sizes = [(rows >> level) * (width >> level) for level in range(1, LEVEL_COUNT)]
        self._smaller = [np.empty(size + SPARE_PIXELS, np.uint8) for size in sizes]
        maps = enumerate(self._levels)
        self._places = [_c_positions(*maps_of, width >> level) for level, maps_of in maps]
        levels = [
            _LevelStructure(len(columns), int(columns[0, 0, 1]), places.ctypes.data)
            for (columns, _), places in zip(self._levels, self._places, strict=True)
        ]
        smaller = [array.ctypes.data for array in self._smaller]
        self._view = _ViewStructure(
            rows, width, len(self.y), tuple(levels), tuple(smaller), self._road.ctypes.data
        )

    def map_picture(self, picture: np.ndarray) -> np.ndarray:
        """The map of a grey picture, overwritten by the next call."""
        part = np.ascontiguousarray(picture[self._first :, :])
        if not self._even or part.dtype != np.uint8 or part.shape != self._shape:
            return super().map_picture(picture)
        self._take_map(ctypes.addressof(self._view), part.ctypes.data)
        return self._road


def _c_positions(columns: np.ndarray, parts: np.ndarray, width: int) -> np.ndarray:
    """The C file's positions of each map point in its row; points outside are at the ends."""
    place = (columns[:, :, 0].astype(np.int32) << 5) + parts
    place = np.clip(place, 0, (width - 1) << 5)
    column = np.minimum(place >> 5, width - 2)
    return np.ascontiguousarray((column << 6) + (place - (column << 5)), np.int32)
