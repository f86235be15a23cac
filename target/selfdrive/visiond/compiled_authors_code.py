"""The detector as the paper's authors coded it, in compiled C if available: the same lines to the bit."""

import ctypes
from pathlib import Path

import numpy as np

from selfdrive.common import compiled
from selfdrive.common.camera_model import CameraModel
from selfdrive.messages import CameraView
from selfdrive.visiond import compiled_windows
from selfdrive.visiond.authors_code_detector import (
    MIN_LOG_ODDS,
    WINDOW_COUNTS,
    WINDOWS_PART,
    WINDOWS_PART_SIZE,
    AuthorsCodeDetector,
)
from selfdrive.visiond.compiled_sums_check import has_identical_sums
from selfdrive.visiond.compiled_windows import MarkWindowFinder
from selfdrive.visiond.detector import LaneLines

C_SOURCE = Path(__file__).with_name("coded_lines.c")
_ARRAY_SHAPES = {  # shape and type of C's outputs, in order
    "power": (WINDOWS_PART_SIZE, np.int32),
    "crest": (WINDOWS_PART_SIZE, np.int32),
    "limits": (WINDOW_COUNTS, np.int32),
    "windows": (WINDOW_COUNTS, np.uint8),
    "counts": (WINDOWS_PART_SIZE, np.uint8),
    "column": (WINDOWS_PART_SIZE[0] * WINDOWS_PART_SIZE[1] + 8, np.int32),
    "root": (WINDOWS_PART_SIZE, np.int32),
    "count": (WINDOWS_PART_SIZE[0] * WINDOWS_PART_SIZE[1] + 8, np.int32),
    "size": (WINDOWS_PART_SIZE, float),
    "mean": (WINDOWS_PART_SIZE, float),
    "room": ((5, *WINDOWS_PART_SIZE), float),
}


class _AuthorsCodeStructure(ctypes.Structure):
    _fields_ = (*((name, ctypes.c_void_p) for name in _ARRAY_SHAPES), ("lines", ctypes.c_double * 2))


def build_authors_code_detector(model: CameraModel, threshold: float = MIN_LOG_ODDS) -> AuthorsCodeDetector:
    libraries = [compiled.library(source) for source in (C_SOURCE, compiled_windows.C_SOURCE)]
    if None in libraries or not has_identical_sums(libraries[0]):
        return AuthorsCodeDetector(model, threshold)
    return CompiledAuthorsCodeDetector(model, threshold, *libraries)


class CompiledAuthorsCodeDetector(AuthorsCodeDetector):
    """AuthorsCodeDetector that calls compiled C: `coded_lines.c` (`lines`), `mark_windows.c` (`windows`)."""

    def __init__(
        self, model: CameraModel, threshold: float, lines: compiled.Library, windows: compiled.Library
    ) -> None:
        super().__init__(model, threshold)
        self.calculated_by = lines.digest.hex() + windows.digest.hex()
        self._windows = MarkWindowFinder(self._net, WINDOWS_PART_SIZE, threshold, windows)
        self._arrays = {name: np.zeros(*room) for name, room in _ARRAY_SHAPES.items()}
        self._coded = _AuthorsCodeStructure(
            **{name: array.ctypes.data for name, array in self._arrays.items()}
        )
        self._at, self._looked_at = ctypes.addressof(self._coded), self._arrays["windows"].ctypes.data
        self._take_edges, self._take_lines = lines.code.take_edges, lines.code.take_lines
        self._take_edges.argtypes, self._take_edges.restype = [ctypes.c_void_p] * 2, None
        self._take_lines.argtypes, self._take_lines.restype = [ctypes.c_void_p], ctypes.c_long

    def detect(self, view: CameraView) -> LaneLines:
        part = np.ascontiguousarray(view.picture[WINDOWS_PART])
        if part.dtype != np.uint8 or part.shape != WINDOWS_PART_SIZE:  # a fault can cause this
            return super().detect(view)
        address = part.ctypes.data
        self._take_edges(self._at, address)
        if not self._windows.clear_windows_without_mark(address, self._looked_at):
            return super().detect(view)
        has_edges = self._take_lines(self._at)
        return self._remember(self._coded.lines if has_edges else None)
