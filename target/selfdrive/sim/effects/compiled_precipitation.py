"""Rain and snow in compiled C, if available and identical to OpenCV."""

import ctypes
from collections.abc import Callable
from dataclasses import astuple
from functools import cache, partial
from math import cos, sin
from pathlib import Path
from typing import NamedTuple

import numpy as np

from selfdrive.common import compiled
from selfdrive.common.camera_model import CameraModel
from selfdrive.sim.effects.air import veil_picture
from selfdrive.sim.effects.effect import Scene
from selfdrive.sim.effects.particles import (
    FAINTEST_SHARE,
    NEAREST_DISTANCE,
    ParticleCover,
    Particles,
    Streaks,
    windows_of_grids,
)
from selfdrive.sim.effects.windscreen import REDUCTION, shrink_picture
from selfdrive.sim.picture import Region, whole

C_SOURCE = Path(__file__).with_name("precipitation.c")
DISC_AREA = 0.25 * np.pi  # of a disc of diameter 1
PROBE_CAMERA = CameraModel(width=88, rows=64)  # small, because every process checks with it
WHOLE_PROBE = whole((PROBE_CAMERA.rows, PROBE_CAMERA.width))
PROBE_AIRLIGHTS = 93.75, 126.25, 11.9, 21.25  # air levels at which fused sums give different bits

_POINTER, _LONG, _FLOAT = ctypes.c_void_p, ctypes.c_long, ctypes.c_float


class PrecipitationParts(NamedTuple):
    particles: Callable[..., Particles]
    cover: Callable[[CameraModel], ParticleCover]
    veil_picture: Callable[[np.ndarray, np.ndarray, np.ndarray, float], np.ndarray]
    shrink: Callable[[np.ndarray, tuple[int, int]], np.ndarray]


PYTHON_PARTS = PrecipitationParts(Particles, ParticleCover, veil_picture, shrink_picture)


def build_precipitation_parts(camera: CameraModel) -> tuple[PrecipitationParts, str]:
    """The parts for a camera, in C if possible, and the digest of their compiled code, if any."""
    library = compiled.library(C_SOURCE)
    # NumPy's scalars, unlike Python's, change arrays to double precision.
    numbers = all(type(number) in (int, float) for number in astuple(camera))
    if library is None or not numbers or not has_identical_parts(library):
        return PYTHON_PARTS, ""
    return _compiled_parts(library), library.digest.hex()


def _compiled_parts(library: compiled.Library) -> PrecipitationParts:
    return PrecipitationParts(
        *(partial(part, library) for part in (CompiledParticles, CompiledCover, _veil_picture, _shrink))
    )


class CompiledParticles(Particles):
    """Particles that calls the compiled `precipitation.c`. The next call overwrites its streaks."""

    def __init__(self, library: compiled.Library, *of) -> None:
        super().__init__(*of)
        self._streaks = library.code.streaks
        self._streaks.argtypes = [_POINTER, _LONG, _POINTER, _POINTER, _LONG, _POINTER, _POINTER]
        self._streaks.restype = _LONG
        of_all = self._reach, self._size, self._speed, self._across, self._down, self._ahead
        self._arrays = (
            np.stack(of_all),
            np.array(self._counts, np.int_),
            np.empty((5, self._size.size), np.float32),
        )
        self._places = [array.ctypes.data for array in self._arrays]

    def streaks(self, scene: Scene, exposure: float) -> Streaks:
        camera, lean, upright = self._camera, sin(self._camera.pitch), cos(self._camera.pitch)
        tall, v_ego = camera.rows / camera.fy, float(scene.v_ego)
        numbers = (
            *(float(lean * scene.t), float(upright / tall * scene.t)),
            *(camera.cx, camera.cy, camera.fx, camera.fy, camera.rows, camera.width),
            *(
                lean,
                upright,
                exposure,
                upright * v_ego,
                lean * v_ego,
                NEAREST_DISTANCE,
                FAINTEST_SHARE,
                DISC_AREA,
            ),
        )
        scene_numbers = np.array(numbers, np.float32)
        driven = np.empty((len(self._counts), 2), np.float32)
        driven[:, 0], driven[:, 1] = (
            self._driven_shares(scene, 1.0, -upright),
            self._driven_shares(scene, tall, lean),
        )
        (of_all, counts, out), outputs = self._places, self._arrays[2]
        moving = driven.ctypes.data, len(self._counts), scene_numbers.ctypes.data
        count = self._streaks(of_all, outputs.shape[1], counts, *moving, out)
        return Streaks(outputs[0:2, :count], outputs[2:4, :count], outputs[4, :count])


class CompiledCover(ParticleCover):
    def __init__(self, library: compiled.Library, camera: CameraModel) -> None:
        super().__init__(camera)
        self._c_covered_shares = library.code.taken
        self._c_covered_shares.argtypes = [
            *[_POINTER] * 3,
            _LONG,
            *[_POINTER] * 3,
            _FLOAT,
            _POINTER,
            _LONG,
            _POINTER,
        ]
        self._c_covered_shares.restype = _LONG
        # Positions of the grids: columns, then rows.
        self._first, self._last = (np.ascontiguousarray(ends.T) for ends in (self._corners, self._ends))

    def covered_shares(self, streaks: Streaks, region: Region) -> np.ndarray:
        start, end, width = map(np.ascontiguousarray, streaks)
        grid_windows = np.array(windows_of_grids(region, self._sizes), np.int_)
        out = np.empty(region.shape, np.uint8)
        arrays = [array.ctypes.data for array in (grid_windows, self._first, self._last)]
        sheet = self._sheet.ctypes.data, self._sheet.shape[1]
        ends = start.ctypes.data, end.ctypes.data, width.ctypes.data
        if self._c_covered_shares(*ends, width.size, *arrays, DISC_AREA, *sheet, out.ctypes.data):
            raise MemoryError
        return out


def _veil_picture(
    library: compiled.Library,
    picture: np.ndarray,
    veil: np.ndarray,
    particle_shares: np.ndarray,
    light: float,
) -> np.ndarray:
    code = library.code.veiled
    code.argtypes = [_POINTER, _LONG, _POINTER, _LONG, _POINTER, _LONG, _LONG, _FLOAT, _FLOAT, _POINTER]
    code.restype = None
    picture, veil, particle_shares = (
        _with_contiguous_rows(picture),
        _with_contiguous_rows(veil),
        np.ascontiguousarray(particle_shares),
    )
    out = np.empty(picture.shape, np.uint8)
    arrays = (
        picture.ctypes.data,
        picture.strides[0],
        veil.ctypes.data,
        veil.strides[0],
        particle_shares.ctypes.data,
    )
    code(*arrays, *picture.shape, -light / 255.0, light, out.ctypes.data)
    return out


def _shrink(library: compiled.Library, picture: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    columns, rows = size
    if picture.shape != (REDUCTION * rows, REDUCTION * columns):
        return shrink_picture(picture, size)
    code = library.code.coarse
    code.argtypes = [_POINTER, _LONG, _LONG, _POINTER, _POINTER]
    code.restype = None
    picture = np.ascontiguousarray(picture)
    out, sums = np.empty((rows, columns), np.uint8), np.empty(REDUCTION * columns, np.uint16)
    code(picture.ctypes.data, rows, columns, sums.ctypes.data, out.ctypes.data)
    return out


def _with_contiguous_rows(picture: np.ndarray) -> np.ndarray:
    return picture if picture.strides[1] == 1 else np.ascontiguousarray(picture)


@cache
def has_identical_parts(library: compiled.Library) -> bool:
    """Whether compiled code gives the installed OpenCV's bits; versions without fused sums differ."""
    number = np.arange(120)
    places = np.stack([number * 37 % 92 - 2.0, number * 53 % 68 - 2.0]).astype(np.float32)
    ways = np.stack([number % 7 * 0.83 - 2.4, number % 5 * 1.37]).astype(np.float32)
    streaks = Streaks(places, places + ways, (number % 12 * 0.53 + 0.2).astype(np.float32))
    level, share = np.divmod(np.arange(64 * 88) * 11, 256)
    picture, veil = (part.astype(np.uint8).reshape(64, 88) for part in (level, share))
    results = []
    for parts in (PYTHON_PARTS, _compiled_parts(library)):
        cover = parts.cover(PROBE_CAMERA)
        particle_shares = cover.covered_shares(streaks, WHOLE_PROBE)
        pictures = [parts.veil_picture(picture, veil, particle_shares, light) for light in PROBE_AIRLIGHTS]
        arrays = cover.half_grid(WHOLE_PROBE), parts.shrink(veil, (11, 8)), *pictures
        results.append([array.tobytes() for array in arrays])
    return results[0] == results[1]
