"""The paper's lane detector, in compiled C if available: the same lines to the bit."""

import ctypes
from math import cos, tan
from pathlib import Path

import numpy as np

from selfdrive.common import compiled
from selfdrive.common.camera_model import CameraModel
from selfdrive.messages import CameraView
from selfdrive.visiond import compiled_windows
from selfdrive.visiond.compiled_sums_check import has_identical_sums
from selfdrive.visiond.compiled_windows import MarkWindowFinder
from selfdrive.visiond.edge_lines import FittedLine
from selfdrive.visiond.hog import WINDOW_STRIDE
from selfdrive.visiond.mark_edges import steepness_limits
from selfdrive.visiond.paper_detector import CLUSTER_REACH, MIN_LOG_ODDS, PaperDetector
from selfdrive.visiond.road_region import RoadRegion

C_SOURCE = Path(__file__).with_name("mark_lines.c")
FLOATS_EXACT_BELOW = 2**24  # smaller integers, and sums of them, are exact in single precision
NO_NUMBER = 2**31 - 1  # larger than any, so that the minimum over neighbours ignores it


class _PointsStructure(ctypes.Structure):
    _fields_ = [(name, ctypes.c_void_p) for name in ("row", "column", "scale", "rising")]


class _PaperStructure(ctypes.Structure):
    _fields_ = (
        *((name, ctypes.c_int64) for name in ("rows", "width", "first_row", "first_column")),
        *((name, ctypes.c_double) for name in ("cx", "horizon", "cos_pitch", "tan_pitch")),
        *((name, ctypes.c_double) for name in ("fx", "fy", "height", "fx_cos")),
        *(
            (name, ctypes.c_void_p)
            for name in ("scale", "windows", "gradient", "sums", "limits", "looked_at")
        ),
        *((name, ctypes.c_void_p) for name in ("at", "label", "mask", "crowd", "number", "run", "named")),
        *((name, ctypes.c_void_p) for name in ("sum", "room")),
        ("all", _PointsStructure),
        ("own", _PointsStructure),
        ("count", ctypes.c_int64),
        ("lines", ctypes.c_double * 8 * 2),  # whether there is one, and a FittedLine
    )


def build_paper_detector(model: CameraModel) -> PaperDetector:
    libraries = [compiled.library(source) for source in (C_SOURCE, compiled_windows.C_SOURCE)]
    if None in libraries or not has_identical_sums(libraries[0]):
        return PaperDetector(model)
    return CompiledPaperDetector(model, *libraries)


class CompiledPaperDetector(PaperDetector):
    """PaperDetector that calls the compiled `mark_lines.c` (`lines`) and `mark_windows.c` (`windows`)."""

    def __init__(self, model: CameraModel, lines: compiled.Library, windows: compiled.Library) -> None:
        super().__init__(model)
        self.calculated_by = lines.digest.hex() + windows.digest.hex()
        self._windows = MarkWindowFinder(self._net, self._region.shape, MIN_LOG_ODDS, windows)
        self._arrays, self._points = (
            _build_arrays(self._region, self._lines.scale),
            {"all": _build_point_arrays(self._region), "own": _build_point_arrays(self._region)},
        )
        self._paper = _PaperStructure(
            **dict(zip(("rows", "width"), self._region.shape, strict=True)),
            first_row=self._region.first_row,
            first_column=self._region.first_column,
            **{name: getattr(model, name) for name in ("cx", "horizon", "fx", "fy", "height")},
            cos_pitch=cos(model.pitch),
            tan_pitch=tan(model.pitch),
            fx_cos=model.fx * cos(model.pitch),
            **{name: array.ctypes.data for name, array in self._arrays.items()},
            **{
                name: _PointsStructure(*[array.ctypes.data for array in arrays])
                for name, arrays in self._points.items()
            },
        )
        self._at = ctypes.addressof(self._paper)
        self._looked_at = self._arrays["looked_at"].ctypes.data
        code = lines.code
        self._take_gradients, self._take_edges, self._take_lines = (
            code.take_gradients,
            code.take_edges,
            code.take_lines,
        )
        for function, count in ((self._take_gradients, 2), (self._take_edges, 1), (self._take_lines, 1)):
            function.argtypes, function.restype = [ctypes.c_void_p] * count, None

    def fit_lines(self, view: CameraView) -> tuple[FittedLine | None, FittedLine | None]:
        part = np.ascontiguousarray(view.picture[self._region.part])
        if part.dtype != np.uint8 or part.shape != self._region.shape:  # a fault can cause this
            return super().fit_lines(view)
        address, sums = part.ctypes.data, self._arrays["sums"]
        self._take_gradients(self._at, address)
        if sums.max() >= FLOATS_EXACT_BELOW:
            return super().fit_lines(view)
        mean = (sums * np.float32(1.0 / WINDOW_STRIDE**2)).astype(np.float32)
        self._arrays["limits"][...] = steepness_limits(mean)
        self._take_edges(self._at)
        if not self._windows.clear_windows_without_mark(address, self._looked_at):
            return super().fit_lines(view)
        self._take_lines(self._at)
        left, right = (FittedLine(*line[1:]) if line[0] else None for line in self._paper.lines)
        return left, right


def _build_arrays(region: RoadRegion, scale: np.ndarray) -> dict[str, np.ndarray]:
    rows, width = region.shape
    tiles, size = (rows // WINDOW_STRIDE, width // WINDOW_STRIDE), rows * width
    return {
        "scale": scale,
        "windows": region.windows.astype(np.uint8),
        "gradient": np.zeros((rows, width), np.int16),
        "sums": np.zeros(tiles, np.int32),
        "limits": np.zeros(tiles, np.float32),
        "looked_at": np.zeros(region.windows.shape, np.uint8),
        "at": np.zeros(size + 8, np.int32),
        "label": np.zeros(size, np.int32),
        "mask": np.zeros((rows + 2 * CLUSTER_REACH) * (width + 2 * CLUSTER_REACH) + rows, np.uint8),
        "crowd": np.zeros((rows, width), np.uint8),
        "number": np.full((rows, width), NO_NUMBER, np.int32),
        "run": np.zeros((size, 4), np.int32),
        "named": np.zeros(size, np.int32),
        "sum": np.zeros((size, 5)),
        "room": np.zeros((5, size)),
    }


def _build_point_arrays(region: RoadRegion) -> list[np.ndarray]:
    size = region.shape[0] * region.shape[1] + 1
    return [np.zeros(size) for _ in range(3)] + [np.zeros(size, np.uint8)]
