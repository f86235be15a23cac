"""The byte format of a run's series, `series/1`: channels at common times, single precision, compressed.

For a faulty run, only channels that differ from its golden run are stored: for each value, the number of
single-precision values between it and the golden value. The second differences over time are split into byte
planes and compressed; see docs/reference/formats.md.
"""

import gzip
import json
import struct
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from mutator._common.bounded_reading import unpacked
from mutator._common.hashing import canonical
from mutator.errors import MutatorError

MOST_BYTES = 32_000_000  # of a run's series
_DAMAGED = (ValueError, LookupError, TypeError, AttributeError, RecursionError)
_LENGTH = struct.Struct("<I")
_LEVEL = 4  # gives one percent more bytes than level 6, in two thirds of the time
_BELOW_SIGN = np.int32(0x7FFFFFFF)
_EMPTY: np.ndarray = np.empty(0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Points:
    """Values at steps between the common times: channel number, time (s) and the values of both runs."""

    channel: np.ndarray = field(default_factory=lambda: _EMPTY.astype(int))
    t: np.ndarray = field(default_factory=lambda: _EMPTY)
    golden: np.ndarray = field(default_factory=lambda: _EMPTY.astype("<f4"))
    faulty: np.ndarray = field(default_factory=lambda: _EMPTY.astype("<f4"))


@dataclass(frozen=True, slots=True, kw_only=True)
class Series:
    """A run at common times `t` (s).

    `rows` has the values of each channel in single precision (NaN: no value). `every` gives n for each
    channel: it has a value at every n-th time. `about` is plain data. `points` are a faulty run's values
    between these times.
    """

    t: np.ndarray
    rows: Sequence[np.ndarray]
    every: Sequence[int]
    about: Mapping[str, Any]
    points: Points = field(default_factory=Points)

    def times(self, channel: int) -> np.ndarray:
        """Return the times (s) at which a channel has values."""
        return self.t[:: self.every[channel]]


def encode(one: Series, golden: Series | None = None) -> bytes:
    """Encode a run; the same run always gives the same bytes. Without `golden`, it is a golden run.

    The times of a faulty run begin with those of `golden`.
    """
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
    """Decode a run that was encoded with `golden`; MutatorError if the bytes are damaged."""
    try:
        return _decode(unpacked(data, MOST_BYTES, gzip=True), golden)
    except (*_DAMAGED, struct.error, zlib.error) as err:
        raise MutatorError(f"a damaged series ({err})", expected="unchanged bytes") from None


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
    if sum(lengths) * words.itemsize > MOST_BYTES:
        raise ValueError(f"values for more than {MOST_BYTES} bytes")
    if len(words) != sum(lengths[channel] for channel in changed) + 2 * len(channels):
        raise ValueError("wrong number of values")
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
    """Yield the reference values of each channel; none exist after the end of the golden run."""
    for channel, length in enumerate(lengths):
        row = np.full(length, np.nan, dtype="<f4")
        if golden is not None:
            there = len(range(0, known, golden.every[channel]))
            row[:there] = golden.rows[channel][:there]
        yield row


def _ordered(values: np.ndarray) -> np.ndarray:
    """Map floats to integers in the same order; neighbouring floats differ by 1."""
    words: np.ndarray = values.view("<i4")
    ordered: np.ndarray = words ^ ((words >> 31) & _BELOW_SIGN)
    return ordered


def _unordered(numbers: np.ndarray) -> np.ndarray:
    words: np.ndarray = numbers ^ ((numbers >> 31) & _BELOW_SIGN)
    return words.view("<f4")


def _words(numbers: np.ndarray) -> np.ndarray:
    """Return the second differences (modulo 2^32) as words that are small for small values of either sign."""
    steps = np.diff(numbers, n=2, prepend=np.zeros(2, dtype="<i4"))
    return ((steps << 1) ^ (steps >> 31)).view("<u4")


def _numbers(words: np.ndarray) -> np.ndarray:
    steps = (words >> 1).view("<i4") ^ -(words & 1).view("<i4")
    numbers: np.ndarray = steps.cumsum(dtype="<i4").cumsum(dtype="<i4")
    return numbers
