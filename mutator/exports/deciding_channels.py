"""The channel that decides an experiment, over time: the one by which its hazard is judged."""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from mutator.errors import MutatorError
from mutator.model import Record
from mutator.outcomes.series_sampling import traces_of_series
from mutator.store.run_folder import RunFolder
from mutator.store.time_series_folder import TimeSeriesFolder
from mutator.targets.manifest import TargetManifest
from mutator.triggers import temporal_logic
from mutator.triggers.conditions import names_in

_TIME_KEY = " time"  # no channel has this name
_POINT_COUNT = 41  # values of each line
_BEFORE_ACTIVATION_S, _AFTER_HAZARD_S = 2.0, 1.0  # shown before the activation and after the hazard


@dataclass(frozen=True, kw_only=True)
class ChannelHistory:
    """A channel around a fault: a value for each of the evenly spaced times (s), without and with the fault.

    `before` is the run with the fault before a change of the controller; None if it is not known over all
    these times.
    """

    name: str
    unit: str
    t: np.ndarray
    golden: np.ndarray | None
    before: np.ndarray | None
    faulty: np.ndarray


@dataclass(frozen=True)
class _SampledRun:
    """The golden and the faulty series of an experiment: times and values by channel."""

    golden: Mapping[str, np.ndarray]
    faulty: Mapping[str, np.ndarray]
    unit_by_channel: Mapping[str, str]

    @classmethod
    def of(cls, folder: RunFolder, record: Record) -> "_SampledRun | None":
        try:
            series = TimeSeriesFolder(folder.path).load_series(record.experiment_id, record)
        except MutatorError:  # damaged: other commands say so
            return None
        if series is None:
            return None
        units = {channel["name"]: channel["unit"] for channel in series[0].facts["channels"]}
        return cls(*traces_of_series(*series, _TIME_KEY), units)


def channel_history(
    folder: RunFolder,
    record: Record,
    hazard: str | None,
    manifest: TargetManifest | None,
    before: tuple[RunFolder, Record] | None = None,
) -> ChannelHistory | None:
    """Return the history of the channel that decides an experiment; None if the run folder has no series.

    `hazard` is the hazard to show, `manifest` the target (None: it is not there), and `before` the same
    experiment in an earlier run.
    """
    run = _SampledRun.of(folder, record)
    if run is None or record.activation is None or not len(run.faulty[_TIME_KEY]):
        return None
    name = deciding_channel(manifest, hazard, record, run.faulty)
    times = _shown_times(run.faulty[_TIME_KEY], record, hazard)
    faulty = None if name is None or times[0] == times[-1] else _values_at(run.faulty, name, times)
    if name is None or faulty is None:
        return None
    earlier = None if before is None else _SampledRun.of(*before)
    return ChannelHistory(
        name=name,
        unit=run.unit_by_channel[name],
        t=times,
        golden=_values_at(run.golden, name, times),
        before=None if earlier is None else _values_at(earlier.faulty, name, times),
        faulty=faulty,
    )


def deciding_channel(
    manifest: TargetManifest | None, hazard: str | None, record: Record, channels: Collection[str]
) -> str | None:
    """Return the first channel in the hazard's margin or condition; if there is none, the actuator that
    changed first, or None.
    """
    for name in _names_in_hazard(manifest, hazard) if manifest and hazard else ():
        if name in channels:
            return name
    first_changed = record.first_change[0] if record.first_change else None
    return first_changed if first_changed in channels else None


def _names_in_hazard(manifest: TargetManifest, hazard: str) -> Iterator[str]:
    """Yield the names in a hazard's formulas, each derived value followed by its inputs."""
    inputs = {value.name: names_in(value.text) for value in manifest.observation.derived}
    channels = [channel.name for channel in manifest.channels]
    formula_names = manifest.observation.names_for_trace_formulas(channels)
    for rule in manifest.hazard_rules:
        if rule.name == hazard:
            formulas = [text for text in (rule.margin, rule.when) if text]
            names = [name for text in formulas for name in names_in(text)]
            for name in (*names, *temporal_logic.names_in_stl(rule.required_stl, formula_names)):
                yield name
                yield from inputs.get(name, ())


def _shown_times(times: np.ndarray, record: Record, hazard: str | None) -> np.ndarray:
    assert record.activation is not None
    end, t_hazard = float(times[-1]), dict(record.hazards).get(hazard or "")
    if t_hazard is not None:
        end = min(end, t_hazard + _AFTER_HAZARD_S)
    begin = max(float(times[0]), min(record.activation.first, end) - _BEFORE_ACTIVATION_S)
    return np.linspace(begin, end, _POINT_COUNT)


def _values_at(run: Mapping[str, np.ndarray], name: str, times: np.ndarray) -> np.ndarray | None:
    """Return the values that a channel holds at these times; None if one is missing or not finite."""
    own_times = run[_TIME_KEY]
    step = times[1] - times[0]
    if name not in run or not len(own_times) or times[-1] > own_times[-1] + step or times[0] < own_times[0]:
        return None
    values = np.asarray(run[name], dtype=float)[np.searchsorted(own_times, times, side="right") - 1]
    return values if np.isfinite(values).all() else None
