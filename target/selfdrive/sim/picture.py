"""A picture of the camera that is not made before its pixels are asked for.

It knows all that its pixels follow from, its `key`: whoever remembers what was seen in a picture of that key
can do without the pixels.
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
        """Rows, columns."""
        return self.bottom - self.top, self.right - self.left

    @property
    def part(self) -> tuple[slice, slice]:
        """The region as it is cut out of a picture."""
        return slice(self.top, self.bottom), slice(self.left, self.right)

    def around(self, margin: int, shape: tuple[int, int]) -> "Region":
        """The region and what lies around it, as far as a picture of that shape goes."""
        return Region(
            max(self.top - margin, 0),
            min(self.bottom + margin, shape[0]),
            max(self.left - margin, 0),
            min(self.right + margin, shape[1]),
        )

    def inside(self, other: "Region") -> tuple[slice, slice]:
        """The region as it is cut out of the pixels of another one that holds it."""
        down, right = self.top - other.top, self.left - other.left
        rows, columns = self.shape
        return slice(down, down + rows), slice(right, right + columns)


def whole(shape: tuple[int, int]) -> Region:
    """All of a picture of that shape."""
    return Region(0, shape[0], 0, shape[1])


Make = Callable[[Region], np.ndarray]


class Picture(NDArrayOperatorsMixin):
    """A grey picture (rows x width, uint8), which may not be written to.

    It may be cut, calculated with and asked as an array may; OpenCV takes `np.asarray` of it. `make` gives
    the pixels of a region, the same as are there in the whole picture. Equal keys mean equal pixels.
    """

    dtype = np.dtype(np.uint8)

    def __init__(self, key: tuple[Hashable, ...], shape: tuple[int, int], make: Make) -> None:
        self.key, self.shape = key, shape
        self._make = make
        self._whole: np.ndarray | None = None

    def changed(self, by: tuple[Hashable, ...], make: Make) -> "Picture":
        """The picture, of the same size, that follows from this one and `by`."""
        return Picture((*self.key, by), self.shape, make)

    def pixels(self) -> np.ndarray:
        """All of it, read-only."""
        if self._whole is None:
            self._whole = _read_only(self._make(whole(self.shape)))
        return self._whole

    def __getitem__(self, where):
        """As an array; for two slices no more than they need is made. The cut is read-only."""
        if self._whole is None and isinstance(where, tuple) and len(where) == 2:
            rows, columns = map(_ends, where, self.shape)
            if rows and columns:
                return _read_only(self._make(Region(*rows, *columns)))
        return self.pixels()[where]

    def __setitem__(self, where, value) -> None:
        self.pixels()[where] = value  # which is read-only

    def __len__(self) -> int:
        return self.shape[0]

    def __array__(self, dtype=None, copy=None) -> np.ndarray:
        return np.array(self.pixels(), dtype=dtype, copy=copy)

    def __array_ufunc__(self, ufunc, method, *inputs, **keywords):
        if "out" in keywords:  # to be refused there, as any read-only array is
            keywords["out"] = tuple(map(_pixels, keywords["out"]))
        return getattr(ufunc, method)(*map(_pixels, inputs), **keywords)

    def __getattr__(self, name: str):
        """Whatever else an array can do."""
        if name.startswith("_"):
            raise AttributeError(name)
        return getattr(self.pixels(), name)


def _ends(part: object, size: int) -> tuple[int, int] | None:
    """First and end of the rows or columns, of `size`, in a slice that goes forwards; None for others."""
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
