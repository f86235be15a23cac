"""The geometric lane detector, in compiled C if available: the same lines to the bit."""

import ctypes
from functools import cache
from math import exp
from pathlib import Path

import numpy as np

from selfdrive.common import compiled
from selfdrive.common.camera_model import CameraModel
from selfdrive.visiond.band_filter import (
    CERTAINTY_PER_RESPONSE,
    MOST_POINTS,
    SKIPPED_BORDER_COLUMNS,
    TEXTURE_WINDOW,
    find_crests,
)
from selfdrive.visiond.compiled_sums_check import has_identical_sums
from selfdrive.visiond.compiled_view import CompiledRoadView
from selfdrive.visiond.road_view import RoadView
from selfdrive.visiond.robust_detector import RobustDetector
from selfdrive.visiond.voting import MOST_LINE_OFFSET, VOTE_BIN_WIDTH, ExpectedPose, LanePose, find_pose

MOST_CANDIDATES = 512  # for the lines' meeting point; MOST in the C file
ROWS_AT_ONCE = 8  # rows that the C file sums at once
C_SOURCES = [Path(__file__).with_name(name) for name in ("band_filter.c", "voting.c", "road_view.c")]


def build_robust_detector(model: CameraModel) -> RobustDetector:
    libraries = [compiled.library(source) for source in C_SOURCES]
    if None in libraries:
        return RobustDetector(model)
    bands, voting, mapping = libraries
    alike = has_identical_maps(mapping, model) and has_identical_crests(bands)
    if not (alike and has_identical_sums(voting) and has_identical_votes(voting, model)):
        return RobustDetector(model)
    view = CompiledRoadView(model, mapping)
    digests = "".join(library.digest.hex() for library in libraries)
    find = CompiledCrests(bands, (len(view.drop), len(view.y)))
    return RobustDetector(model, view, find, CompiledVote(voting, view), digests)


class _BandsStructure(ctypes.Structure):
    _fields_ = (
        ("road", ctypes.c_void_p),
        *((name, ctypes.c_int64) for name in ("rows", "width")),
        *((name, ctypes.c_void_p) for name in ("eroded", "opened", "contrast", "rough", "sums")),
        *((name, ctypes.c_void_p) for name in ("column", "padded", "sure", "at", "weight")),
        ("steepness", ctypes.c_float),
    )


class CompiledCrests:
    """`find_crests` for maps of one shape, in the compiled `band_filter.c`."""

    def __init__(self, library: compiled.Library, shape: tuple[int, int]) -> None:
        self._crests = library.code.crests
        self._crests.argtypes, self._crests.restype = [ctypes.c_void_p], ctypes.c_long
        self._shape, inner = shape, shape[1] - 2 * SKIPPED_BORDER_COLUMNS
        points = shape[0], inner
        self._arrays = {
            "eroded": np.empty(shape, np.uint8),
            "opened": np.empty(shape, np.uint8),
            "contrast": np.empty(points, np.float32),
            "rough": np.empty(points, np.float32),
            "sums": np.empty((shape[0] + ROWS_AT_ONCE, inner)),
            "column": np.empty(inner),
            "padded": np.zeros((ROWS_AT_ONCE, inner + TEXTURE_WINDOW[0])),
            "sure": np.empty(inner, np.float32),
            "at": np.empty(shape[0] * inner + 1, np.int64),
            "weight": np.empty(shape[0] * inner + 1, np.float32),
        }
        rooms = {name: array.ctypes.data for name, array in self._arrays.items()}
        self._bands = _BandsStructure(
            rows=shape[0], width=shape[1], steepness=CERTAINTY_PER_RESPONSE, **rooms
        )
        self._address = ctypes.addressof(self._bands)

    def __call__(self, road: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        if road.shape != self._shape or road.dtype != np.uint8:  # a fault can cause this
            return find_crests(road)
        road = np.ascontiguousarray(road)
        self._bands.road = road.ctypes.data
        count = self._crests(self._address)
        return self._arrays["at"][:count].copy(), self._arrays["weight"][:count].copy()


@cache
def has_identical_maps(library: compiled.Library, model: CameraModel) -> bool:
    """Whether compiled maps equal the installed OpenCV's; versions can interpolate differently."""
    shape = model.rows, model.width
    noise = (
        (np.arange(model.rows * model.width, dtype=np.uint32) * 40503 >> 7).astype(np.uint8).reshape(shape)
    )
    return np.array_equal(
        CompiledRoadView(model, library).map_picture(noise), RoadView(model).map_picture(noise)
    )


@cache
def has_identical_crests(library: compiled.Library) -> bool:
    """Whether compiled crests equal the installed OpenCV's; versions can add in a different order."""
    number = np.arange(48 * 260)
    road = (60 + number * 40503 % 65521 % 61 + 12 * (number % 260 % 37 < 3)).astype(np.uint8).reshape(48, 260)
    compiled_crests, python_crests = CompiledCrests(library, road.shape)(road), find_crests(road)
    return all(
        np.array_equal(compiled_values, other)
        for compiled_values, other in zip(compiled_crests, python_crests, strict=True)
    )


class _MapStructure(ctypes.Structure):
    _fields_ = (
        *((name, ctypes.c_void_p) for name in ("y", "drop", "scale", "share")),
        *((name, ctypes.c_int64) for name in ("rows", "columns", "edge")),
        *((name, ctypes.c_void_p) for name in ("left", "below", "metre", "weight", "precision")),
        *((name, ctypes.c_void_p) for name in ("room", "found", "supports")),
    )


class CompiledVote:
    """`find_pose` for maps of `view`, in the compiled `voting.c`."""

    def __init__(self, library: compiled.Library, view: RoadView) -> None:
        pointer, number = ctypes.c_void_p, ctypes.c_long
        self._vote = library.code.vote
        self._vote.argtypes, self._vote.restype = [*[pointer] * 4, number, *[pointer] * 2], number
        self._shape = len(view.drop), len(view.y)
        self._arrays = {name: getattr(view, name) for name in ("y", "drop", "scale", "share")}
        for name in ("left", "below", "metre", "weight", "precision"):
            self._arrays[name] = np.empty(MOST_POINTS, np.float32)
        self._arrays |= {
            "room": np.empty((18, MOST_POINTS)),
            "found": np.empty((5, MOST_POINTS)),
            "supports": np.empty((MOST_CANDIDATES, round(2 * MOST_LINE_OFFSET / VOTE_BIN_WIDTH))),
        }
        places = {name: array.ctypes.data for name, array in self._arrays.items()}
        self._map = _MapStructure(
            rows=self._shape[0], columns=self._shape[1], edge=SKIPPED_BORDER_COLUMNS, **places
        )
        self._belief, self._pose = (ctypes.c_double * 8)(), (ctypes.c_double * 6)()

    def __call__(
        self, view: RoadView, road: np.ndarray, at: np.ndarray, weight: np.ndarray, belief: ExpectedPose
    ) -> LanePose:
        if road.shape != self._shape or road.dtype != np.uint8 or not road.flags.c_contiguous:
            return find_pose(view, road, at, weight, belief)  # a fault can cause this
        at, weight = np.ascontiguousarray(at, np.int64), np.ascontiguousarray(weight, np.float32)
        self._belief[:] = [*belief.meeting_left, *belief.meeting_dip, *belief.middle, *belief.width]
        points = at.ctypes.data, weight.ctypes.data, len(at)
        of = ctypes.addressof(self._map)
        if not self._vote(of, road.ctypes.data, *points, self._belief, self._pose):
            return find_pose(view, road, at, weight, belief)
        *pose, left, right = self._pose
        return LanePose(*pose, 1.0 - exp(left), 1.0 - exp(right))


@cache
def has_identical_votes(library: compiled.Library, model: CameraModel) -> bool:
    """Whether compiled votes equal those with the installed OpenCV; versions can add in a different order."""
    view = RoadView(model)
    number = np.arange(400)
    road = (np.arange(len(view.drop) * len(view.y)) % 251).astype(np.uint8).reshape(len(view.drop), -1)
    row, column = (
        number * 7 % len(view.drop),
        number * number * 13 % (len(view.y) - 2 * SKIPPED_BORDER_COLUMNS),
    )
    points = (
        row * (len(view.y) - 2 * SKIPPED_BORDER_COLUMNS) + column,
        np.sqrt(number / 400).astype(np.float32),
    )
    beliefs = ExpectedPose(), ExpectedPose(meeting_left=(3.3, 7.1), width=(3.4, 0.02), meeting_dip=(0.7, 1.5))
    compiled_vote = CompiledVote(library, view)
    return all(
        compiled_vote(view, road, *points, each) == find_pose(view, road, *points, each) for each in beliefs
    )
