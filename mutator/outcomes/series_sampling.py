"""Samples a run's channels into its series: six digits, at most 20 values a second (internal channels: 10).

A sample is the newest value at its time, so events shorter than 50 ms can fall between samples. Channels that
differ from golden therefore keep extra points: the first differing step, the steps of the largest difference
in the drive and in the whole run, and the last step of a run that ended early. All channels keep the steps in
which a hazard first occurred, so that replays show the values on which the verdict is based.
"""

from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from mutator.model import Record
from mutator.outcomes.golden_comparison import Trace, on_steps
from mutator.outcomes.trace_files import own_times
from mutator.store.series_folder import SeriesFolder, run_facts, write_kept_series
from mutator.store.series_format import ExtraPoints, Series, encode_series
from mutator.targets.channels import Channel, Role
from mutator.targets.manifest import TargetManifest

RATE = 20.0  # maximum number of samples per second
_EVERY = {Role.ACTUATOR: 1, Role.TRUTH: 1, Role.INTERNAL: 2}  # a channel keeps every n-th sample
_HALF = np.uint32(8)  # half of the lowest bit that is kept
_TINY = 1e-9  # s; times are sums of steps


class Sampler:
    """Builds the series of a golden run, and the series of the faulty runs compared with it."""

    def __init__(self, manifest: TargetManifest, golden: Trace) -> None:
        self._channels = [c for c in (*manifest.compared, *manifest.plotted) if c.name in golden]
        self._clock = manifest.time_channel
        self._time = np.asarray(golden[self._clock], dtype=float)
        self._values = self._on(golden, self._time)
        self._every = [_EVERY[channel.role] for channel in self._channels]
        self._at = _thinned(self._time)
        self.golden = Series(
            t=self._time[self._at],
            channel_values=self._rows(self._values[:, self._at]),
            sample_every=self._every,
            facts={
                "start": float(self._time[0]),
                "end": float(self._time[-1]),
                "channels": [
                    _told(channel, manifest)
                    | ({"own_times": True} if own_times(channel.name) in golden else {})
                    for channel in self._channels
                ],
            },
        )

    @cached_property
    def encoded(self) -> bytes:
        return encode_series(self.golden)

    def series(self, faulty: Trace, record: Record) -> Series:
        own = np.asarray(faulty[self._clock], dtype=float)
        last = own[-1] if len(own) else -np.inf
        is_prefix = _is_prefix(own, self._time)
        time, golden, values = self._together(faulty, own)
        known = self.golden.t[self.golden.t <= last + _TINY]
        late = np.flatnonzero(time > self._time[-1] + _TINY)
        at = np.concatenate((np.searchsorted(time, known), late[_thinned(time[late])])).astype(int)
        end = int(np.searchsorted(time, min(last, self._time[-1]), side="right")) - 1
        compared = end + 1 if is_prefix else len(time)  # as `golden.deviation` compares them
        return Series(
            t=time[at],
            channel_values=self._rows(values[:, at]),
            sample_every=self._every,
            facts=run_facts(record) | {"end": float(max(self._time[-1], last))},
            points=_points(
                time, golden[:, :compared], values[:, :compared], self._sampled(len(time), at), end, record
            ),
        )

    def _sampled(self, count: int, at: np.ndarray) -> np.ndarray:
        if count == len(self._time) and len(at) == len(self._at):
            return self._usual
        return self._marked(count, at)

    @cached_property
    def _usual(self) -> np.ndarray:
        return self._marked(len(self._time), self._at)

    def _marked(self, count: int, at: np.ndarray) -> np.ndarray:
        sampled = np.zeros((len(self._every), count), dtype=bool)
        for row, every in zip(sampled, self._every, strict=True):
            row[at[::every]] = True
        return sampled

    def _rows(self, values: np.ndarray) -> list[np.ndarray]:
        single = _single(values)
        return [np.ascontiguousarray(row[::every]) for row, every in zip(single, self._every, strict=True)]

    def _together(self, faulty: Trace, own: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the union of both runs' step times, and each run's values. After its end, a run has no value
        (NaN) or, if the runs have different times, its last one.
        """
        if _is_prefix(own, self._time):
            time = max(own, self._time, key=len)
            return time, _filled(self._values, len(time)), _filled(self._on(faulty, own), len(time))
        time = np.union1d(own, self._time)
        return time, self._held(self._values, self._time, time), self._held(self._on(faulty, own), own, time)

    def _on(self, trace: Trace, time: np.ndarray) -> np.ndarray:
        """Return an array with a row for each channel and a column for each step. Missing channels: NaN."""
        rows = np.full((len(self._channels), len(time)), np.nan)
        for row, channel in zip(rows, self._channels, strict=True):
            if channel.name in trace:
                row[:] = on_steps(trace, channel.name, time)
        return rows

    @staticmethod
    def _held(values: np.ndarray, own: np.ndarray, time: np.ndarray) -> np.ndarray:
        """Return the newest value of each row at the given times; NaN before its first."""
        place = np.searchsorted(own, time + _TINY, side="right") - 1
        return np.where(place >= 0, values[:, np.maximum(place, 0)], np.nan)


def _is_prefix(own: np.ndarray, other: np.ndarray) -> bool:
    """Whether two runs have the same times up to the end of the shorter one."""
    rows = min(len(own), len(other))
    return bool(np.array_equal(own[:rows], other[:rows]))


def _thinned(time: np.ndarray) -> np.ndarray:
    """Return the steps to keep: the first, the last, and at most RATE a second in between."""
    kept: list[int] = []
    due = -np.inf
    for place, t in enumerate(time.tolist()):
        if t >= due:
            due = t + 1.0 / RATE - _TINY
            kept.append(place)
    if kept and kept[-1] != len(time) - 1:
        kept.append(len(time) - 1)
    return np.array(kept, dtype=int)


def _filled(values: np.ndarray, count: int) -> np.ndarray:
    missing = count - values.shape[1]
    if not missing:
        return values
    return np.concatenate((values, np.full((len(values), missing), np.nan)), axis=1)


def _single(values: np.ndarray) -> np.ndarray:
    """Round the values to single precision and six digits (20 bits). More digits would make a series a tenth
    larger.
    """
    with np.errstate(over="ignore"):  # overflow becomes infinity
        single = values.astype("<f4")
        words = (single.view("<u4") + _HALF) & ~np.uint32(2 * _HALF - 1)
    finite = np.isfinite(single)
    single[np.isnan(single)] = np.nan  # the same bit pattern for every NaN
    return np.where(finite, words.view("<f4"), single)


def _points(
    time: np.ndarray,
    golden: np.ndarray,
    faulty: np.ndarray,
    sampled: np.ndarray,
    end: int,
    record: Record,
) -> ExtraPoints:
    """Return the steps that each channel keeps in addition to the `sampled` ones.

    `end` is the last step that both runs have. `golden` and `faulty` end with the last step that is compared.
    """
    drive = end + 1 if record.t_end is None else _until(time, record.t_end)
    hazards = {_until(time, t) - 1 for _, t in record.hazards} & set(range(end + 1))
    found: list[tuple[int, int]] = []
    for row, differs in enumerate((golden != faulty).any(axis=1).tolist()):
        steps = set(hazards)
        if differs:
            gap = _gap(golden[row], faulty[row])  # row by row: all rows would not fit into the CPU cache
            apart = gap > 0.0
            peaks = {int(np.argmax(apart)), int(np.argmax(gap[: max(drive, 1)])), int(np.argmax(gap)), end}
            steps |= {step for step in peaks if apart[step]}
        found += [(row, step) for step in sorted(steps) if not sampled[row, step]]
    rows, places = np.array(found, dtype=int).reshape(-1, 2).T
    one, other = _single(golden[rows, places]), _single(faulty[rows, places])
    shown = (one.view("<u4") != other.view("<u4")) | np.isin(places, list(hazards))
    return ExtraPoints(
        channel_numbers=rows[shown], t=time[places[shown]], golden=one[shown], faulty=other[shown]
    )


def _until(time: np.ndarray, t: float) -> int:
    return int(np.searchsorted(time, t + _TINY, side="right"))


def _gap(golden: np.ndarray, faulty: np.ndarray) -> np.ndarray:
    """Return the absolute difference of two runs at each step; infinite if only one has a value."""
    with np.errstate(invalid="ignore", over="ignore"):
        gap: np.ndarray = np.abs(faulty - golden)
    odd = np.isnan(gap)
    if odd.any():
        same = (golden == faulty) | (np.isnan(golden) & np.isnan(faulty))
        gap[odd] = np.where(same[odd], 0.0, np.inf)
    return gap


def _told(channel: Channel, manifest: TargetManifest) -> dict[str, Any]:
    return {
        "name": channel.name,
        "unit": channel.unit,
        "role": channel.role.value,
        "component": channel.component,
        "about": channel.about,
        "compared": channel in manifest.compared,
    }


def sampled_traces(golden: Series, faulty: Series, time: str) -> tuple[Trace, Trace]:
    """Return the runs of a series as traces. Between its samples, a channel holds its value."""
    names = [str(channel["name"]) for channel in golden.facts["channels"]]

    def trace(run: Series) -> Trace:
        rows = [
            np.repeat(row, every)[: len(run.t)]
            for row, every in zip(run.channel_values, run.sample_every, strict=True)
        ]
        return {time: run.t, **dict(zip(names, rows, strict=True))}

    return trace(golden), trace(faulty)


def keep_series(run: Path, manifest: TargetManifest, golden: Trace, faulty: Trace, record: Record) -> None:
    sampler = Sampler(manifest, golden)
    data = encode_series(sampler.series(faulty, record), sampler.golden)
    write_kept_series(SeriesFolder(run).kept_path(record.experiment_id), sampler.encoded, data)
