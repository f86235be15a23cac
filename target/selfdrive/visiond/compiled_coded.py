"""The detector as coded with its arithmetic in C, where this was compiled: the same lines to the bit."""

import numpy as np

from selfdrive.common import compiled
from selfdrive.common.camera_model import CameraModel
from selfdrive.visiond.coded_detector import SIZE, THRESHOLD, WINDOWS, CodedDetector
from selfdrive.visiond.compiled_windows import C_SOURCE, MarkWindows


def build_coded_detector(model: CameraModel) -> CodedDetector:
    """The detector, compiled where it is to be used and has been."""
    library = compiled.library(C_SOURCE)
    return CompiledCodedDetector(model, library) if library else CodedDetector(model)


class CompiledCodedDetector(CodedDetector):
    """Does what CodedDetector does: `windows` is `mark_windows.c`, compiled."""

    def __init__(self, model: CameraModel, windows: compiled.Library) -> None:
        super().__init__(model)
        self.calculated_by = windows.digest.hex()
        self._windows = MarkWindows(SIZE, THRESHOLD, windows)

    def _marked(self, part: np.ndarray, looked_at: np.ndarray) -> np.ndarray:
        marked = np.zeros(WINDOWS, bool)
        marked.ravel()[looked_at] = True
        if part.dtype != np.uint8 or not self._windows.decide(part.ctypes.data, marked.ctypes.data):
            return super()._marked(part, looked_at)
        return np.flatnonzero(marked)
