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

from mutator._common.bounded_reading import decompress_bounded
from mutator._common.hashing import canonical_json
from mutator.errors import MutatorError

MOST_SERIES_BYTES = 32_000_000  # of a run; an hour of 100 channels at 20 values a second has 29 MB
_DECODE_ERRORS = (ValueError, LookupError, TypeError, AttributeError, RecursionError)
_LENGTH_STRUCT = struct.Struct("<I")
_GZIP_LEVEL = 4  # gives one percent more bytes than level 6, in two thirds of the time
_ALL_BITS_BUT_SIGN = np.int32(0x7FFFFFFF)
_NO_VALUES: np.ndarray = np.empty(0)


@dataclass(frozen=True, slots=True, kw_only=True)
class ExtraPoints:
    """Values at steps between the common times: channel number, time (s) and the values of both runs."""

    channel_numbers: np.ndarray = field(default_factory=lambda: _NO_VALUES.astype(int))
    t: np.ndarray = field(default_factory=lambda: _NO_VALUES)
    golden_values: np.ndarray = field(default_factory=lambda: _NO_VALUES.astype("<f4"))
    faulty_values: np.ndarray = field(default_factory=lambda: _NO_VALUES.astype("<f4"))


@dataclass(frozen=True, slots=True, kw_only=True)
class Series:
    """A run at common times `t` (s).

    `channel_values` has the values of each channel in single precision (NaN: no value). `sample_every` gives
    n for each channel: it has a value at every n-th time. `facts` is plain data. `extra_points` are a faulty
    run's values between these times.
    """

    t: np.ndarray
    channel_values: Sequence[np.ndarray]
    sample_every: Sequence[int]
    facts: Mapping[str, Any]
    extra_points: ExtraPoints = field(default_factory=ExtraPoints)

    def times_of(self, channel: int) -> np.ndarray:
        """Return the times (s) at which a channel has values."""
        return self.t[:: self.sample_every[channel]]


def encode_series(series: Series, golden: Series | None = None) -> bytes:
    """Encode a run; the same run always gives the same bytes. Without `golden`, it is a golden run.

    The times of a faulty run begin with those of `golden`.
    """
    shared_steps = 0
    if golden is not None and len(series.t):
        shared_steps = int(np.searchsorted(golden.t, series.t[-1], side="right"))
    differences = [
        _ordered_integers(row) - _ordered_integers(reference)
        for row, reference in zip(
            series.channel_values,
            _reference_values(golden, shared_steps, map(len, series.channel_values)),
            strict=True,
        )
    ]
    changed = [channel for channel, row in enumerate(differences) if golden is None or row.any()]
    points = series.extra_points
    head = {
        **series.facts,
        "known": shared_steps,
        "more": len(series.t) - shared_steps,
        "changed": changed,
        "points": points.channel_numbers.tolist(),
        **({"every": list(series.sample_every)} if golden is None else {}),
    }
    words = [
        *(_second_difference_words(differences[channel]) for channel in changed),
        points.golden_values,
        points.faulty_values,
    ]
    planes = np.concatenate([row.view("<u4") for row in words]).view(np.uint8).reshape(-1, 4).T
    text = canonical_json(head).encode()
    times = (series.t[shared_steps:].astype("<f8").tobytes(), points.t.astype("<f8").tobytes())
    raw = b"".join((_LENGTH_STRUCT.pack(len(text)), text, *times, planes.tobytes()))
    return gzip.compress(raw, compresslevel=_GZIP_LEVEL, mtime=0)  # with a time, equal runs would differ


def decode_series(data: bytes, golden: Series | None = None) -> Series:
    """Decode a run that was encoded with `golden`; MutatorError if the bytes are damaged."""
    try:
        return _decode_unpacked(decompress_bounded(data, MOST_SERIES_BYTES, gzip=True), golden)
    except (*_DECODE_ERRORS, struct.error, zlib.error) as err:
        raise MutatorError(f"a damaged series ({err})", expected="unchanged bytes") from None


def _decode_unpacked(raw: bytes, golden: Series | None) -> Series:
    (length,) = _LENGTH_STRUCT.unpack_from(raw)
    at = _LENGTH_STRUCT.size + length
    about = json.loads(raw[_LENGTH_STRUCT.size : at])
    shared_steps, later_steps, changed, channels = (
        about.pop(key) for key in ("known", "more", "changed", "points")
    )
    every = about.pop("every") if golden is None else golden.sample_every
    times = np.frombuffer(raw, "<f8", later_steps + len(channels), at)
    words = np.frombuffer(raw, np.uint8, -1, at + times.nbytes).reshape(4, -1).T.copy().view("<u4").ravel()
    t = (
        times[:later_steps].copy()
        if golden is None
        else np.concatenate((golden.t[:shared_steps], times[:later_steps]))
    )
    lengths = [len(t[::step]) for step in every]
    if sum(lengths) * words.itemsize > MOST_SERIES_BYTES:
        raise ValueError(f"values for more than {MOST_SERIES_BYTES} bytes")
    if len(words) != sum(lengths[channel] for channel in changed) + 2 * len(channels):
        raise ValueError("wrong number of values")
    rows = list(_reference_values(golden, shared_steps, lengths))
    begin = 0
    for channel in changed:
        differences = _numbers_of_words(words[begin : begin + lengths[channel]])
        rows[channel] = _floats_of_ordered(differences + _ordered_integers(rows[channel]))
        begin += lengths[channel]
    point_values = words[begin:].view("<f4").reshape(2, -1)
    points = ExtraPoints(
        channel_numbers=np.array(channels, dtype=int),
        t=times[later_steps:],
        golden_values=point_values[0],
        faulty_values=point_values[1],
    )
    return Series(t=t, channel_values=rows, sample_every=every, facts=about, extra_points=points)


def _reference_values(
    golden: Series | None, shared_steps: int, lengths: Iterable[int]
) -> Iterator[np.ndarray]:
    """Yield the reference values of each channel; none exist after the end of the golden run."""
    for channel, length in enumerate(lengths):
        row = np.full(length, np.nan, dtype="<f4")
        if golden is not None:
            shared_length = len(range(0, shared_steps, golden.sample_every[channel]))
            row[:shared_length] = golden.channel_values[channel][:shared_length]
        yield row


def _ordered_integers(values: np.ndarray) -> np.ndarray:
    """Map floats to integers in the same order; neighbouring floats differ by 1."""
    words: np.ndarray = values.view("<i4")
    ordered: np.ndarray = words ^ ((words >> 31) & _ALL_BITS_BUT_SIGN)
    return ordered


def _floats_of_ordered(numbers: np.ndarray) -> np.ndarray:
    words: np.ndarray = numbers ^ ((numbers >> 31) & _ALL_BITS_BUT_SIGN)
    return words.view("<f4")


def _second_difference_words(numbers: np.ndarray) -> np.ndarray:
    """Return the second differences (modulo 2^32) as words that are small for small values of either sign."""
    steps = np.diff(numbers, n=2, prepend=np.zeros(2, dtype="<i4"))
    return ((steps << 1) ^ (steps >> 31)).view("<u4")


def _numbers_of_words(words: np.ndarray) -> np.ndarray:
    steps = (words >> 1).view("<i4") ^ -(words & 1).view("<i4")
    numbers: np.ndarray = steps.cumsum(dtype="<i4").cumsum(dtype="<i4")
    return numbers
