"""The geometric lane detector with its fit in C, where this was compiled: the same lines to the bit."""

import ctypes
from pathlib import Path

import numpy as np

from selfdrive.common import compiled
from selfdrive.common.array_math import product
from selfdrive.common.camera_model import CameraModel
from selfdrive.visiond.band_filter import STRONGEST
from selfdrive.visiond.compiled_sums import adds_up_alike
from selfdrive.visiond.robust_detector import RobustDetector
from selfdrive.visiond.voting import Fitted, Voters

C_SOURCE = Path(__file__).with_name("voting.c")


def build_robust_detector(model: CameraModel) -> RobustDetector:
    """The detector, compiled where it is to be used and has been."""
    library = compiled.library(C_SOURCE)
    if library is None or not adds_up_alike(library):
        return RobustDetector(model)
    return RobustDetector(model, CompiledSettle(library), library.digest.hex())


class CompiledSettle:
    """Does what `settled` does: `library` is `voting.c`, compiled."""

    def __init__(self, library: compiled.Library) -> None:
        self._settle = library.code.settle
        self._settle.argtypes = [*[ctypes.c_void_p] * 4, ctypes.c_long, *[ctypes.c_void_p] * 8]
        self._settle.restype = None
        self._room = np.empty((20, STRONGEST))
        self._results = np.empty((5, STRONGEST))

    def __call__(
        self, state: np.ndarray, voters: Voters, expected: np.ndarray, believed: np.ndarray
    ) -> Fitted:
        """The state moved, and what the last step had."""
        points = voters.left, voters.drop, voters.metre, voters.precision
        n = len(voters.left)
        prior, state = product(expected.T, expected), state.copy()
        numbers = self._results.ravel()
        metre, error, count = numbers[:n], numbers[n : 3 * n], numbers[3 * n : 5 * n]
        given = [np.ascontiguousarray(part, np.float32) for part in points]
        beliefs = [np.ascontiguousarray(part) for part in (expected, believed, prior)]
        used = (*beliefs, state, metre, error, count, self._room)
        self._settle(*[part.ctypes.data for part in given], n, *[part.ctypes.data for part in used])
        return Fitted(state, metre, error.reshape(2, n), count.reshape(2, n))
