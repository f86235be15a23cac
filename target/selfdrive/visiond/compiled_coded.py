"""The detector as coded, in compiled C if available: the same lines to the bit."""

import ctypes
from pathlib import Path

import numpy as np

from selfdrive.common import compiled
from selfdrive.common.camera_model import CameraModel
from selfdrive.messages import CameraView
from selfdrive.visiond import compiled_windows
from selfdrive.visiond.coded_detector import PART, SIZE, THRESHOLD, WINDOWS, CodedDetector
from selfdrive.visiond.compiled_sums import adds_up_alike
from selfdrive.visiond.compiled_windows import MarkWindows
from selfdrive.visiond.detector import LaneLines

C_SOURCE = Path(__file__).with_name("coded_lines.c")
_ROOMS = {  # shape and type of C's outputs, in order
    "power": (SIZE, np.int32),
    "crest": (SIZE, np.int32),
    "limits": (WINDOWS, np.int32),
    "windows": (WINDOWS, np.uint8),
    "counts": (SIZE, np.uint8),
    "column": (SIZE[0] * SIZE[1] + 8, np.int32),
    "root": (SIZE, np.int32),
    "count": (SIZE[0] * SIZE[1] + 8, np.int32),
    "size": (SIZE, float),
    "mean": (SIZE, float),
    "room": ((5, *SIZE), float),
}


class _Coded(ctypes.Structure):
    _fields_ = (*((name, ctypes.c_void_p) for name in _ROOMS), ("lines", ctypes.c_double * 2))


def build_coded_detector(model: CameraModel) -> CodedDetector:
    libraries = [compiled.library(source) for source in (C_SOURCE, compiled_windows.C_SOURCE)]
    if None in libraries or not adds_up_alike(libraries[0]):
        return CodedDetector(model)
    return CompiledCodedDetector(model, *libraries)


class CompiledCodedDetector(CodedDetector):
    """CodedDetector that calls the compiled `coded_lines.c` (`lines`) and `mark_windows.c` (`windows`)."""

    def __init__(self, model: CameraModel, lines: compiled.Library, windows: compiled.Library) -> None:
        super().__init__(model)
        self.calculated_by = lines.digest.hex() + windows.digest.hex()
        self._windows = MarkWindows(SIZE, THRESHOLD, windows)
        self._arrays = {name: np.zeros(*room) for name, room in _ROOMS.items()}
        self._coded = _Coded(**{name: array.ctypes.data for name, array in self._arrays.items()})
        self._at, self._looked_at = ctypes.addressof(self._coded), self._arrays["windows"].ctypes.data
        self._take_edges, self._take_lines = lines.code.take_edges, lines.code.take_lines
        self._take_edges.argtypes, self._take_edges.restype = [ctypes.c_void_p] * 2, None
        self._take_lines.argtypes, self._take_lines.restype = [ctypes.c_void_p], ctypes.c_long

    def detect(self, view: CameraView) -> LaneLines:
        part = np.ascontiguousarray(view.picture[PART])
        if part.dtype != np.uint8 or part.shape != SIZE:  # a fault can cause this
            return super().detect(view)
        address = part.ctypes.data
        self._take_edges(self._at, address)
        if not self._windows.decide(address, self._looked_at):
            return super().detect(view)
        seen = self._take_lines(self._at)
        return self._kept(self._coded.lines if seen else None)
