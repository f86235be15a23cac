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
from mutator.outcomes.trace_and_record_loading import Trace, values_on_steps
from mutator.outcomes.trace_files import own_times
from mutator.store.series_format import ExtraPoints, Series, encode_series
from mutator.store.time_series_folder import TimeSeriesFolder, run_facts_for_series, write_rerun_series
from mutator.targets.channels import Channel, Role
from mutator.targets.manifest import TargetManifest

MOST_SAMPLES_PER_S = 20.0  # maximum number of samples per second
# a channel keeps every n-th sample
_SAMPLE_EVERY_NTH_BY_ROLE = {Role.ACTUATOR: 1, Role.TRUTH: 1, Role.INTERNAL: 2}
_HALF_OF_LAST_BIT = np.uint32(8)  # half of the lowest bit that is kept
_TIME_SLACK_S = 1e-9  # s; times are sums of steps


class SeriesSampler:
    """Builds the series of a golden run, and the series of the faulty runs compared with it."""

    def __init__(self, manifest: TargetManifest, golden: Trace) -> None:
        self._channels = [
            c for c in (*manifest.compared_channels, *manifest.non_actuator_channels) if c.name in golden
        ]
        self._clock = manifest.time_channel
        self._time = np.asarray(golden[self._clock], dtype=float)
        self._values = self._values_at_steps(golden, self._time)
        self._sample_every = [_SAMPLE_EVERY_NTH_BY_ROLE[channel.role] for channel in self._channels]
        self._sample_steps = _thinned_steps(self._time)
        self.golden = Series(
            t=self._time[self._sample_steps],
            channel_values=self._sampled_rows(self._values[:, self._sample_steps]),
            sample_every=self._sample_every,
            facts={
                "start": float(self._time[0]),
                "end": float(self._time[-1]),
                "channels": [
                    _channel_as_json(channel, manifest)
                    | ({"own_times": True} if own_times(channel.name) in golden else {})
                    for channel in self._channels
                ],
            },
        )

    @cached_property
    def encoded_golden(self) -> bytes:
        return encode_series(self.golden)

    def faulty_series(self, faulty: Trace, record: Record) -> Series:
        faulty_time = np.asarray(faulty[self._clock], dtype=float)
        last = faulty_time[-1] if len(faulty_time) else -np.inf
        is_prefix = _has_same_times_until_shorter_ends(faulty_time, self._time)
        time, golden, values = self._values_at_common_times(faulty, faulty_time)
        golden_samples = self.golden.t[self.golden.t <= last + _TIME_SLACK_S]
        late_steps = np.flatnonzero(time > self._time[-1] + _TIME_SLACK_S)
        steps = np.concatenate(
            (np.searchsorted(time, golden_samples), late_steps[_thinned_steps(time[late_steps])])
        ).astype(int)
        end = int(np.searchsorted(time, min(last, self._time[-1]), side="right")) - 1
        compared = end + 1 if is_prefix else len(time)  # as `golden.deviation` compares them
        return Series(
            t=time[steps],
            channel_values=self._sampled_rows(values[:, steps]),
            sample_every=self._sample_every,
            facts=run_facts_for_series(record) | {"end": float(max(self._time[-1], last))},
            extra_points=_extra_points(
                time,
                golden[:, :compared],
                values[:, :compared],
                self._sample_mask(len(time), steps),
                end,
                record,
            ),
        )

    def _sample_mask(self, step_count: int, steps: np.ndarray) -> np.ndarray:
        if step_count == len(self._time) and len(steps) == len(self._sample_steps):
            return self._golden_sample_mask
        return self._build_sample_mask(step_count, steps)

    @cached_property
    def _golden_sample_mask(self) -> np.ndarray:
        return self._build_sample_mask(len(self._time), self._sample_steps)

    def _build_sample_mask(self, step_count: int, steps: np.ndarray) -> np.ndarray:
        sampled = np.zeros((len(self._sample_every), step_count), dtype=bool)
        for row, every in zip(sampled, self._sample_every, strict=True):
            row[steps[::every]] = True
        return sampled

    def _sampled_rows(self, values: np.ndarray) -> list[np.ndarray]:
        single = _rounded_singles(values)
        return [
            np.ascontiguousarray(row[::every]) for row, every in zip(single, self._sample_every, strict=True)
        ]

    def _values_at_common_times(
        self, faulty: Trace, faulty_time: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the union of both runs' step times, and each run's values. After its end, a run has no value
        (NaN) or, if the runs have different times, its last one.
        """
        if _has_same_times_until_shorter_ends(faulty_time, self._time):
            time = max(faulty_time, self._time, key=len)
            return (
                time,
                _padded_with_nan(self._values, len(time)),
                _padded_with_nan(self._values_at_steps(faulty, faulty_time), len(time)),
            )
        time = np.union1d(faulty_time, self._time)
        return (
            time,
            self._newest_values(self._values, self._time, time),
            self._newest_values(self._values_at_steps(faulty, faulty_time), faulty_time, time),
        )

    def _values_at_steps(self, trace: Trace, time: np.ndarray) -> np.ndarray:
        """Return an array with a row for each channel and a column for each step. Missing channels: NaN."""
        rows = np.full((len(self._channels), len(time)), np.nan)
        for row, channel in zip(rows, self._channels, strict=True):
            if channel.name in trace:
                row[:] = values_on_steps(trace, channel.name, time)
        return rows

    @staticmethod
    def _newest_values(values: np.ndarray, times_of_run: np.ndarray, time: np.ndarray) -> np.ndarray:
        """Return the newest value of each row at the given times; NaN before its first."""
        place = np.searchsorted(times_of_run, time + _TIME_SLACK_S, side="right") - 1
        return np.where(place >= 0, values[:, np.maximum(place, 0)], np.nan)


def _has_same_times_until_shorter_ends(times: np.ndarray, other_times: np.ndarray) -> bool:
    """Whether two runs have the same times up to the end of the shorter one."""
    rows = min(len(times), len(other_times))
    return bool(np.array_equal(times[:rows], other_times[:rows]))


def _thinned_steps(time: np.ndarray) -> np.ndarray:
    """Return the steps to keep: the first, the last, and at most RATE a second in between."""
    steps: list[int] = []
    due = -np.inf
    for place, t in enumerate(time.tolist()):
        if t >= due:
            due = t + 1.0 / MOST_SAMPLES_PER_S - _TIME_SLACK_S
            steps.append(place)
    if steps and steps[-1] != len(time) - 1:
        steps.append(len(time) - 1)
    return np.array(steps, dtype=int)


def _padded_with_nan(values: np.ndarray, count: int) -> np.ndarray:
    missing = count - values.shape[1]
    if not missing:
        return values
    return np.concatenate((values, np.full((len(values), missing), np.nan)), axis=1)


def _rounded_singles(values: np.ndarray) -> np.ndarray:
    """Round the values to single precision and six digits (20 bits). More digits would make a series a tenth
    larger.
    """
    with np.errstate(over="ignore"):  # overflow becomes infinity
        single = values.astype("<f4")
        words = (single.view("<u4") + _HALF_OF_LAST_BIT) & ~np.uint32(2 * _HALF_OF_LAST_BIT - 1)
    finite = np.isfinite(single)
    single[np.isnan(single)] = np.nan  # the same bit pattern for every NaN
    return np.where(finite, words.view("<f4"), single)


def _extra_points(
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
    drive = end + 1 if record.t_end is None else _step_count_until(time, record.t_end)
    hazards = {_step_count_until(time, t) - 1 for _, t in record.hazards} & set(range(end + 1))
    points: list[tuple[int, int]] = []
    for row, differs in enumerate((golden != faulty).any(axis=1).tolist()):
        steps = set(hazards)
        if differs:
            # row by row: all rows would not fit into the CPU cache
            gap = _absolute_difference(golden[row], faulty[row])
            apart = gap > 0.0
            peaks = {int(np.argmax(apart)), int(np.argmax(gap[: max(drive, 1)])), int(np.argmax(gap)), end}
            steps |= {step for step in peaks if apart[step]}
        points += [(row, step) for step in sorted(steps) if not sampled[row, step]]
    rows, places = np.array(points, dtype=int).reshape(-1, 2).T
    golden_points, faulty_points = (
        _rounded_singles(golden[rows, places]),
        _rounded_singles(faulty[rows, places]),
    )
    is_visible = (golden_points.view("<u4") != faulty_points.view("<u4")) | np.isin(places, list(hazards))
    return ExtraPoints(
        channel_numbers=rows[is_visible],
        t=time[places[is_visible]],
        golden_values=golden_points[is_visible],
        faulty_values=faulty_points[is_visible],
    )


def _step_count_until(time: np.ndarray, t: float) -> int:
    return int(np.searchsorted(time, t + _TIME_SLACK_S, side="right"))


def _absolute_difference(golden: np.ndarray, faulty: np.ndarray) -> np.ndarray:
    """Return the absolute difference of two runs at each step; infinite if only one has a value."""
    with np.errstate(invalid="ignore", over="ignore"):
        gap: np.ndarray = np.abs(faulty - golden)
    odd = np.isnan(gap)
    if odd.any():
        same = (golden == faulty) | (np.isnan(golden) & np.isnan(faulty))
        gap[odd] = np.where(same[odd], 0.0, np.inf)
    return gap


def _channel_as_json(channel: Channel, manifest: TargetManifest) -> dict[str, Any]:
    return {
        "name": channel.name,
        "unit": channel.unit,
        "role": channel.role.value,
        "component": channel.component,
        "about": channel.about,
        "compared": channel in manifest.compared_channels,
    }


def traces_of_series(golden: Series, faulty: Series, time_channel: str) -> tuple[Trace, Trace]:
    """Return the runs of a series as traces. Between its samples, a channel holds its value."""
    names = [str(channel["name"]) for channel in golden.facts["channels"]]

    def trace(run: Series) -> Trace:
        rows = [
            np.repeat(row, every)[: len(run.t)]
            for row, every in zip(run.channel_values, run.sample_every, strict=True)
        ]
        return {time_channel: run.t, **dict(zip(names, rows, strict=True))}

    return trace(golden), trace(faulty)


def write_sampled_series(
    run: Path, manifest: TargetManifest, golden: Trace, faulty: Trace, record: Record
) -> None:
    sampler = SeriesSampler(manifest, golden)
    data = encode_series(sampler.faulty_series(faulty, record), sampler.golden)
    write_rerun_series(
        TimeSeriesFolder(run).rerun_series_path(record.experiment_id), sampler.encoded_golden, data
    )
