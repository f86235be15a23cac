"""A picture of the camera that is not made before its pixels are asked for.

It knows all that its pixels follow from, its `key`: whoever remembers what was seen in a picture of that key
can do without the pixels.
"""

from collections.abc import Callable, Hashable

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin


class Picture(NDArrayOperatorsMixin):
    """A grey picture (rows x width, uint8), which may not be written to.

    It may be cut, calculated with and asked as an array may; OpenCV takes `np.asarray` of it. `make` gives
    the picture's first rows and columns, at least as many as it is asked for. Equal keys mean equal pixels.
    """

    dtype = np.dtype(np.uint8)

    def __init__(
        self, key: tuple[Hashable, ...], shape: tuple[int, int], make: Callable[[int, int], np.ndarray]
    ) -> None:
        self.key, self.shape = key, shape
        self._make = make
        self._whole: np.ndarray | None = None

    def changed(self, by: tuple[Hashable, ...], make: Callable[[int, int], np.ndarray]) -> "Picture":
        """The picture, of the same size, that follows from this one and `by`."""
        return Picture((*self.key, by), self.shape, make)

    def pixels(self) -> np.ndarray:
        """All of it, read-only."""
        if self._whole is None:
            self._whole = _read_only(self._make(*self.shape))
        return self._whole

    def __getitem__(self, where):
        """As an array; for two slices no more than they need is made. The cut is read-only."""
        if self._whole is None and isinstance(where, tuple) and len(where) == 2:
            ends = [_end(part, size) for part, size in zip(where, self.shape, strict=True)]
            if all(ends):
                return _read_only(self._make(*ends)[where])
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


def _end(part: object, size: int) -> int:
    """How many of `size` rows or columns a slice that goes forwards reaches into; 0 for anything else."""
    if not isinstance(part, slice) or part.step is not None or (part.start or 0) < 0:
        return 0
    return size if part.stop is None else min(part.stop, size) if part.stop > 0 else 0


def _read_only(pixels: np.ndarray) -> np.ndarray:
    view = pixels.view()
    view.flags.writeable = False
    return view


def _pixels(value: object) -> object:
    return value.pixels() if isinstance(value, Picture) else value
