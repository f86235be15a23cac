"""The bytes of a run's series, `series/1`: channels on common times, in single precision, compressed.

Of a run with a fault only the channels are kept that differ from its golden run, as how far they are from
it: so many numbers of single precision lie between two values, and by how much that changes from one time to
the next is what is stored, byte by byte in planes, compressed. docs/reference/formats.md has the layout.
"""

import gzip
import json
import struct
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from mutator._common.hashing import canonical
from mutator.errors import MutatorError

_LENGTH = struct.Struct("<I")
_LEVEL = 6
_BELOW_SIGN = np.int32(0x7FFFFFFF)
_EMPTY: np.ndarray = np.empty(0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Points:
    """Values at steps between the common times: the number of a channel, its time (s), both runs' values."""

    channel: np.ndarray = field(default_factory=lambda: _EMPTY.astype(int))
    t: np.ndarray = field(default_factory=lambda: _EMPTY)
    golden: np.ndarray = field(default_factory=lambda: _EMPTY.astype("<f4"))
    faulty: np.ndarray = field(default_factory=lambda: _EMPTY.astype("<f4"))


@dataclass(frozen=True, slots=True, kw_only=True)
class Series:
    """A run on common times `t` (s): `values` has a row for each channel, in single precision (NaN: none).

    `about` is plain data that goes with it. `points` are those of a run with a fault between these times.
    """

    t: np.ndarray
    values: np.ndarray
    about: Mapping[str, Any]
    points: Points = field(default_factory=Points)


def encode(one: Series, golden: Series | None = None) -> bytes:
    """The bytes of a run with a fault, whose times are the first ones of `golden`, and then its own; those of
    a golden run without `golden`. The same bytes each time."""
    known = 0 if golden is None else int(np.isin(golden.t, one.t).sum())
    apart = _ordered(one.values.astype("<f4", copy=False)) - _ordered(_reference(golden, known, one))
    changed = np.arange(len(apart)) if golden is None else np.flatnonzero(apart.any(axis=1))
    points = one.points
    head = {
        **one.about,
        "known": known,
        "more": len(one.t) - known,
        "changed": changed.tolist(),
        "points": points.channel.tolist(),
    }
    flat = (_changes(apart[changed]).ravel(), points.golden.view("<u4"), points.faulty.view("<u4"))
    planes = np.concatenate(flat).astype("<u4", copy=False).view(np.uint8).reshape(-1, 4).T
    text = canonical(head).encode()
    times = (one.t[known:].astype("<f8").tobytes(), points.t.astype("<f8").tobytes())
    raw = b"".join((_LENGTH.pack(len(text)), text, *times, planes.tobytes()))
    return gzip.compress(raw, compresslevel=_LEVEL, mtime=0)


def decode(data: bytes, golden: Series | None = None) -> Series:
    """The run of these bytes, which were made with `golden`; MutatorError where they are damaged."""
    try:
        return _decode(gzip.decompress(data), golden)
    except (ValueError, LookupError, TypeError, struct.error, EOFError, OSError, zlib.error) as err:
        raise MutatorError(f"a damaged series ({err})", expected="bytes as they were written") from None


def _decode(raw: bytes, golden: Series | None) -> Series:
    (length,) = _LENGTH.unpack_from(raw)
    at = _LENGTH.size + length
    about = json.loads(raw[_LENGTH.size : at])
    known, more, changed, channels = (about.pop(key) for key in ("known", "more", "changed", "points"))
    times = np.frombuffer(raw, "<f8", more + len(channels), at)
    at += times.nbytes
    words = np.frombuffer(raw, np.uint8, -1, at).reshape(4, -1).T.copy().view("<u4").ravel()
    own = times[:more]
    t = own.copy() if golden is None else np.concatenate((golden.t[:known], own))
    count, rows = len(t), len(changed) if golden is None else len(golden.values)
    if len(words) != len(changed) * count + 2 * len(channels):
        raise ValueError("another number of values")
    apart = np.zeros((rows, count), dtype="<i4")
    apart[changed] = _sums(words[: len(changed) * count].reshape(len(changed), count))
    blank = Series(t=t, values=apart, about={})
    values = _unordered(apart + _ordered(_reference(golden, known, blank)))
    rest = words[len(changed) * count :].view("<f4").reshape(2, -1)
    points = Points(channel=np.array(channels, dtype=int), t=times[more:], golden=rest[0], faulty=rest[1])
    return Series(t=t, values=values, about=about, points=points)


def _reference(golden: Series | None, known: int, one: Series) -> np.ndarray:
    """The values that those of `one` are compared with."""
    values = np.full(one.values.shape, np.nan, dtype="<f4")
    if golden is not None:
        values[:, :known] = golden.values[:, :known]
    return values


def _ordered(values: np.ndarray) -> np.ndarray:
    """Whole numbers in the order of the values: neighbours differ by 1."""
    words: np.ndarray = values.view("<i4")
    ordered: np.ndarray = words ^ ((words >> 31) & _BELOW_SIGN)
    return ordered


def _unordered(numbers: np.ndarray) -> np.ndarray:
    words: np.ndarray = numbers ^ ((numbers >> 31) & _BELOW_SIGN)
    return words.view("<f4")


def _changes(numbers: np.ndarray) -> np.ndarray:
    """How much each number of a row is more than the one before it (modulo 2^32), as words that are small for
    small numbers of either sign."""
    steps = np.diff(numbers, axis=1, prepend=np.int32(0))
    return ((steps << 1) ^ (steps >> 31)).view("<u4")


def _sums(words: np.ndarray) -> np.ndarray:
    """The numbers of which `_changes` made words."""
    steps = (words >> 1).view("<i4") ^ -(words & 1).view("<i4")
    return np.cumsum(steps, axis=1, dtype="<i4")
