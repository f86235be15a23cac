"""The bytes of a run's series, `series/1`: channels on common times, in single precision, compressed.

Of a run with a fault only the channels are kept that differ from its golden run, as how far they are from
it: so many numbers of single precision lie between two values, and how that goes on from one time to the next
is what is stored, byte by byte in planes, compressed. docs/reference/formats.md has the layout.
"""

import gzip
import json
import struct
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from mutator._common.hashing import canonical
from mutator.errors import MutatorError

_LENGTH = struct.Struct("<I")
_LEVEL = 4  # a hundredth larger than 6 makes it, in two thirds of the time
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
    """A run on common times `t` (s): `rows` has the values of each channel, in single precision (NaN: none),
    at each time, or at each second, third, ... of them, as `every` says.

    `about` is plain data that goes with it. `points` are those of a run with a fault between these times.
    """

    t: np.ndarray
    rows: Sequence[np.ndarray]
    every: Sequence[int]
    about: Mapping[str, Any]
    points: Points = field(default_factory=Points)

    def times(self, channel: int) -> np.ndarray:
        """The times (s) of a channel's values."""
        return self.t[:: self.every[channel]]


def encode(one: Series, golden: Series | None = None) -> bytes:
    """The bytes of a run with a fault, whose times are the first ones of `golden`, and then its own; those of
    a golden run without `golden`. The same bytes each time."""
    known = 0
    if golden is not None and len(one.t):
        known = int(np.searchsorted(golden.t, one.t[-1], side="right"))
    apart = [
        _ordered(row) - _ordered(reference)
        for row, reference in zip(one.rows, _references(golden, known, map(len, one.rows)), strict=True)
    ]
    changed = [channel for channel, row in enumerate(apart) if golden is None or row.any()]
    points = one.points
    head = {
        **one.about,
        "known": known,
        "more": len(one.t) - known,
        "changed": changed,
        "points": points.channel.tolist(),
        **({"every": list(one.every)} if golden is None else {}),
    }
    words = [*(_words(apart[channel]) for channel in changed), points.golden, points.faulty]
    planes = np.concatenate([row.view("<u4") for row in words]).view(np.uint8).reshape(-1, 4).T
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
    every = about.pop("every") if golden is None else golden.every
    times = np.frombuffer(raw, "<f8", more + len(channels), at)
    words = np.frombuffer(raw, np.uint8, -1, at + times.nbytes).reshape(4, -1).T.copy().view("<u4").ravel()
    t = times[:more].copy() if golden is None else np.concatenate((golden.t[:known], times[:more]))
    lengths = [len(t[::step]) for step in every]
    if len(words) != sum(lengths[channel] for channel in changed) + 2 * len(channels):
        raise ValueError("another number of values")
    rows = list(_references(golden, known, lengths))
    begin = 0
    for channel in changed:
        apart = _numbers(words[begin : begin + lengths[channel]])
        rows[channel] = _unordered(apart + _ordered(rows[channel]))
        begin += lengths[channel]
    rest = words[begin:].view("<f4").reshape(2, -1)
    points = Points(channel=np.array(channels, dtype=int), t=times[more:], golden=rest[0], faulty=rest[1])
    return Series(t=t, rows=rows, every=every, about=about, points=points)


def _references(golden: Series | None, known: int, lengths: Iterable[int]) -> Iterator[np.ndarray]:
    """Of each channel the values that others are compared with: none after the end of golden."""
    for channel, length in enumerate(lengths):
        row = np.full(length, np.nan, dtype="<f4")
        if golden is not None:
            there = len(range(0, known, golden.every[channel]))
            row[:there] = golden.rows[channel][:there]
        yield row


def _ordered(values: np.ndarray) -> np.ndarray:
    """Whole numbers in the order of the values: neighbours differ by 1."""
    words: np.ndarray = values.view("<i4")
    ordered: np.ndarray = words ^ ((words >> 31) & _BELOW_SIGN)
    return ordered


def _unordered(numbers: np.ndarray) -> np.ndarray:
    words: np.ndarray = numbers ^ ((numbers >> 31) & _BELOW_SIGN)
    return words.view("<f4")


def _words(numbers: np.ndarray) -> np.ndarray:
    """How the change from each number to the next changes (modulo 2^32), as words that are small for small
    changes of either sign."""
    steps = np.diff(numbers, n=2, prepend=np.zeros(2, dtype="<i4"))
    return ((steps << 1) ^ (steps >> 31)).view("<u4")


def _numbers(words: np.ndarray) -> np.ndarray:
    """The numbers of which `_words` made words."""
    steps = (words >> 1).view("<i4") ^ -(words & 1).view("<i4")
    numbers: np.ndarray = steps.cumsum(dtype="<i4").cumsum(dtype="<i4")
    return numbers
