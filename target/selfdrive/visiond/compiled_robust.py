"""The geometric lane detector with its arithmetic in C, where that was compiled: equal lines to the bit."""

import ctypes
from functools import cache
from pathlib import Path

import numpy as np

from selfdrive.common import compiled
from selfdrive.common.array_math import product
from selfdrive.common.camera_model import CameraModel
from selfdrive.visiond.band_filter import EDGE, NEIGHBOURHOOD, STEEPNESS, STRONGEST, Points, crests
from selfdrive.visiond.compiled_sums import adds_up_alike
from selfdrive.visiond.compiled_view import CompiledRoadView
from selfdrive.visiond.road_view import RoadView
from selfdrive.visiond.robust_detector import RobustDetector
from selfdrive.visiond.voting import BIN, SIDEWAYS, Belief, Fitted, Pose, Voters, elect

CANDIDATES = 512  # points where lines may meet, MOST of the C file
AT_ONCE = 8  # rows, of the C file
C_SOURCES = [Path(__file__).with_name(name) for name in ("band_filter.c", "voting.c", "road_view.c")]


def build_robust_detector(model: CameraModel) -> RobustDetector:
    """The detector, compiled where it is to be used and has been."""
    libraries = [compiled.library(source) for source in C_SOURCES]
    if None in libraries:
        return RobustDetector(model)
    bands, voting, mapping = libraries
    alike = maps_alike(mapping, model) and finds_alike(bands)
    if not (alike and adds_up_alike(voting) and elects_alike(voting, model)):
        return RobustDetector(model)
    view = CompiledRoadView(model, mapping)
    digests = "".join(library.digest.hex() for library in libraries)
    find = CompiledCrests(bands, (len(view.drop), len(view.y)))
    return RobustDetector(model, view, find, CompiledElect(voting), CompiledSettle(voting), digests)


class _Bands(ctypes.Structure):
    """`Bands` of the C file."""

    _fields_ = (
        ("road", ctypes.c_void_p),
        *((name, ctypes.c_int64) for name in ("rows", "width")),
        *((name, ctypes.c_void_p) for name in ("eroded", "opened", "contrast", "rough", "sums")),
        *((name, ctypes.c_void_p) for name in ("column", "padded", "sure", "at", "weight")),
        ("steepness", ctypes.c_float),
    )


class CompiledCrests:
    """Does what `crests` does in maps of that shape: `library` is `band_filter.c`, compiled."""

    def __init__(self, library: compiled.Library, shape: tuple[int, int]) -> None:
        self._crests = library.code.crests
        self._crests.argtypes, self._crests.restype = [ctypes.c_void_p], ctypes.c_long
        self._shape, inner = shape, shape[1] - 2 * EDGE
        points = shape[0], inner
        self._arrays = {
            "eroded": np.empty(shape, np.uint8),
            "opened": np.empty(shape, np.uint8),
            "contrast": np.empty(points, np.float32),
            "rough": np.empty(points, np.float32),
            "sums": np.empty((shape[0] + AT_ONCE, inner)),
            "column": np.empty(inner),
            "padded": np.zeros((AT_ONCE, inner + NEIGHBOURHOOD[0])),
            "sure": np.empty(inner, np.float32),
            "at": np.empty(shape[0] * inner + 1, np.int64),
            "weight": np.empty(shape[0] * inner + 1, np.float32),
        }
        rooms = {name: array.ctypes.data for name, array in self._arrays.items()}
        self._bands = _Bands(rows=shape[0], width=shape[1], steepness=STEEPNESS, **rooms)
        self._address = ctypes.addressof(self._bands)

    def __call__(self, road: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Numbers and weights of the points."""
        if road.shape != self._shape or road.dtype != np.uint8:  # a fault may do that to a picture
            return crests(road)
        road = np.ascontiguousarray(road)
        self._bands.road = road.ctypes.data
        count = self._crests(self._address)
        return self._arrays["at"][:count].copy(), self._arrays["weight"][:count].copy()


@cache
def maps_alike(library: compiled.Library, model: CameraModel) -> bool:
    """Whether maps have the bits of OpenCV's: those of another version may be taken from parts of pixels."""
    shape = model.rows, model.width
    noise = (
        (np.arange(model.rows * model.width, dtype=np.uint32) * 40503 >> 7).astype(np.uint8).reshape(shape)
    )
    return np.array_equal(CompiledRoadView(model, library).map(noise), RoadView(model).map(noise))


@cache
def finds_alike(library: compiled.Library) -> bool:
    """Whether crests have the bits of OpenCV's means: those of another version may add up otherwise."""
    number = np.arange(48 * 260)
    road = (60 + number * 40503 % 65521 % 61 + 12 * (number % 260 % 37 < 3)).astype(np.uint8).reshape(48, 260)
    found, wanted = CompiledCrests(library, road.shape)(road), crests(road)
    return all(np.array_equal(one, other) for one, other in zip(found, wanted, strict=True))


class CompiledElect:
    """Does what `elect` does: `library` is `voting.c`, compiled."""

    def __init__(self, library: compiled.Library) -> None:
        pointer, number, real = ctypes.c_void_p, ctypes.c_long, ctypes.c_double
        self._elect = library.code.elect
        self._elect.argtypes = [*[pointer] * 4, number, real, *[pointer] * 3]
        self._elect.restype = number
        self._room = np.empty((CANDIDATES, round(2 * SIDEWAYS / BIN)))
        self._belief, self._pose = (ctypes.c_double * 8)(), (ctypes.c_double * 4)()

    def __call__(self, voters: Voters, belief: Belief) -> Pose:
        """The pair of lines with the most support."""
        points = voters.left, voters.drop, voters.metre, voters.weight
        given = [np.ascontiguousarray(part, np.float32) for part in points]
        self._belief[:] = [*belief.left, *belief.dip, *belief.middle, *belief.width]
        used = [part.ctypes.data for part in given], len(voters.left), voters.rows
        room = self._room.ctypes.data
        if not self._elect(*used[0], *used[1:], self._belief, room, self._pose):
            return elect(voters, belief)
        return Pose(*self._pose)


@cache
def elects_alike(library: compiled.Library, model: CameraModel) -> bool:
    """Whether an election has the bits of OpenCV's filters: those of another version may add up otherwise."""
    view = RoadView(model)
    number = np.arange(400)
    row, column = number * 7 % len(view.drop), number * number * 13 % len(view.y)
    points = Points(row, column, np.sqrt(number / 400).astype(np.float32))
    voters = Voters(view, points, 100.0)
    beliefs = Belief(), Belief(left=(3.3, 7.1), width=(3.4, 0.02), dip=(0.7, 1.5))
    return all(CompiledElect(library)(voters, belief) == elect(voters, belief) for belief in beliefs)


class CompiledSettle:
    """Does what `settled` does: `library` is `voting.c`, compiled."""

    def __init__(self, library: compiled.Library) -> None:
        self._settle = library.code.settle
        self._settle.argtypes = [*[ctypes.c_void_p] * 4, ctypes.c_long, *[ctypes.c_void_p] * 8]
        self._settle.restype = None
        self._room = np.empty((18, STRONGEST))
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
