"""A camera picture whose pixels are calculated only when needed.

Its `key` identifies everything that determines the pixels, so results stored by key need no pixels.
"""

from collections.abc import Callable, Hashable
from typing import NamedTuple

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin


class Region(NamedTuple):
    """Rows `top` to `bottom` - 1 and columns `left` to `right` - 1 of a picture."""

    top: int
    bottom: int
    left: int
    right: int

    @property
    def shape(self) -> tuple[int, int]:
        return self.bottom - self.top, self.right - self.left

    @property
    def part(self) -> tuple[slice, slice]:
        return slice(self.top, self.bottom), slice(self.left, self.right)

    def around(self, margin: int, shape: tuple[int, int]) -> "Region":
        """The region enlarged by `margin` on each side, within a picture of that shape."""
        return Region(
            max(self.top - margin, 0),
            min(self.bottom + margin, shape[0]),
            max(self.left - margin, 0),
            min(self.right + margin, shape[1]),
        )

    def inside(self, other: "Region") -> tuple[slice, slice]:
        """Slices of the region in the pixels of a region that contains it."""
        down, right = self.top - other.top, self.left - other.left
        rows, columns = self.shape
        return slice(down, down + rows), slice(right, right + columns)


def whole(shape: tuple[int, int]) -> Region:
    return Region(0, shape[0], 0, shape[1])


Make = Callable[[Region], np.ndarray]


class Picture(NDArrayOperatorsMixin):
    """A grey picture (rows x width, uint8), read-only.

    It supports slicing, arithmetic and attributes like an array; for OpenCV use `np.asarray`. `make` returns
    the pixels of a region. Equal keys mean equal pixels.
    """

    dtype = np.dtype(np.uint8)

    def __init__(self, key: tuple[Hashable, ...], shape: tuple[int, int], make: Make) -> None:
        self.key, self.shape = key, shape
        self._make = make
        self._whole: np.ndarray | None = None

    def changed(self, by: tuple[Hashable, ...], make: Make) -> "Picture":
        return Picture((*self.key, by), self.shape, make)

    def pixels(self) -> np.ndarray:
        if self._whole is None:
            self._whole = _read_only(self._make(whole(self.shape)))
        return self._whole

    def __getitem__(self, where):
        """Index like an array; for two slices, only their pixels are calculated. Read-only."""
        if self._whole is None and isinstance(where, tuple) and len(where) == 2:
            rows, columns = map(_ends, where, self.shape)
            if rows and columns:
                return _read_only(self._make(Region(*rows, *columns)))
        return self.pixels()[where]

    def __setitem__(self, where, value) -> None:
        self.pixels()[where] = value  # raises: read-only

    def __len__(self) -> int:
        return self.shape[0]

    def __array__(self, dtype=None, copy=None) -> np.ndarray:
        return np.array(self.pixels(), dtype=dtype, copy=copy)

    def __array_ufunc__(self, ufunc, method, *inputs, **keywords):
        if "out" in keywords:  # raises like any read-only array
            keywords["out"] = tuple(map(_pixels, keywords["out"]))
        return getattr(ufunc, method)(*map(_pixels, inputs), **keywords)

    def __getattr__(self, name: str):
        if name.startswith("_"):
            raise AttributeError(name)
        return getattr(self.pixels(), name)


def _ends(part: object, size: int) -> tuple[int, int] | None:
    """Start and end of a forward slice of `size` rows or columns; None for other slices."""
    if not isinstance(part, slice) or part.step is not None:
        return None
    first, end, _ = part.indices(size)
    return (first, end) if first < end else None


def _read_only(pixels: np.ndarray) -> np.ndarray:
    view = pixels.view()
    view.flags.writeable = False
    return view


def _pixels(value: object) -> object:
    return value.pixels() if isinstance(value, Picture) else value
