"""Streaks, flakes and droplets in compiled C, if available and identical to NumPy."""

import ctypes
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from selfdrive.common import compiled
from selfdrive.sim.effects import scattered
from selfdrive.sim.effects.scattered import Streak

C_SOURCE = Path(__file__).with_name("scattered.c")
PROBE, COUNT = (300, 700), 5000  # a shape and a number of droplets for which random numbers are rejected

_POINTER, _LONG = ctypes.c_void_p, ctypes.c_long


class Scattered(NamedTuple):
    streak_light: Callable[..., np.ndarray]
    flake_light: Callable[..., np.ndarray]
    droplets: Callable[[np.random.Generator, tuple[int, int], int], np.ndarray]


PLAIN = Scattered(scattered.streak_light, scattered.flake_light, scattered.droplets)


def build_scattered() -> tuple[Scattered, str]:
    """The functions, in C if possible, and the digest of their compiled code, if any."""
    library = compiled.library(C_SOURCE)
    if library is None or not agrees(library):
        return PLAIN, ""
    parts = [partial(part, library) for part in (_streak_light, _flake_light, _droplets)]
    return Scattered(*parts), library.digest.hex()


def _streak_light(
    library: compiled.Library,
    chances: np.ndarray,
    streak: Streak,
    levels: np.ndarray,
    box: np.ndarray,
    shape: tuple[int, int],
) -> np.ndarray:
    code = library.code.streaks
    code.argtypes = [_POINTER, _LONG, _LONG, *[_POINTER] * 3, _LONG, _POINTER, _POINTER, *[_LONG] * 3]
    code.argtypes += [_POINTER, _POINTER]
    code.restype = None
    margin = scattered.reach(streak)
    wide = np.zeros((2, shape[0] + 2 * margin, shape[1] + 2 * margin), np.uint8)
    places = box.ctypes.data, box[2:].ctypes.data, streak.pixels.ctypes.data, len(streak.pixels)
    of_streaks = chances.ctypes.data, *chances.shape[:2], *places, streak.way.ctypes.data, levels.ctypes.data
    code(*of_streaks, *shape, margin, wide[0].ctypes.data, wide[1].ctypes.data)
    return wide[0, margin:-margin, margin:-margin]


def _flake_light(
    library: compiled.Library, places: np.ndarray, flakes: np.ndarray, columns: int, first: int, end: int
) -> np.ndarray:
    code = library.code.flakes
    code.argtypes = [_POINTER, _LONG, _LONG, _POINTER, *[_LONG] * 4, _POINTER]
    code.restype = None
    size = flakes.shape[1]
    light = np.zeros((end - first + size + 1, columns), np.uint16)
    of_flakes = places.ctypes.data, *places.shape, flakes.ctypes.data, size
    code(*of_flakes, columns, first * columns, end * columns, light.ctypes.data)
    return light


def _droplets(
    library: compiled.Library, random: np.random.Generator, shape: tuple[int, int], count: int
) -> np.ndarray:
    code = library.code.droplets
    code.argtypes = [_POINTER, ctypes.c_int64, _LONG, ctypes.c_uint32, _POINTER]
    code.restype = None
    state = random.bit_generator.state
    numbers = [part for name in ("state", "inc") for part in divmod(state["state"][name], 1 << 64)]
    generator = np.array(numbers, np.uint64)
    kept = state["uinteger"] if state["has_uint32"] else -1
    picture = np.zeros(shape, np.uint8)
    code(generator.ctypes.data, kept, count, picture.size, picture.ctypes.data)
    return picture


@cache
def agrees(library: compiled.Library) -> bool:
    """Whether compiled code draws NumPy's random numbers, which can differ between versions."""
    seen = []
    for drawn in (scattered.droplets, partial(_droplets, library)):
        random = np.random.Generator(np.random.PCG64(11))
        random.random(1, np.float32)  # uses half of a random number
        seen.append(drawn(random, PROBE, COUNT).tobytes())
    return seen[0] == seen[1]
