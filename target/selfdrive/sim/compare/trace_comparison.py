"""Compares a trace with its reference by channel."""

from dataclasses import dataclass
from math import inf

import numpy as np

from selfdrive.common.errors import ConfigError
from selfdrive.sim.compare import key_figures
from selfdrive.sim.compare.tolerances import ChannelLimits, Tolerances
from selfdrive.sim.compare.trace_csv import (
    COLUMN_BY_CHANNEL,
    STEPS_PER_SECOND,
    ReferenceTrace,
    TraceColumn,
    comparable_channels,
)

_MOST_LAG_STEPS = 100  # steps, that is 1 s
_MIN_VARIATION = 1e-6  # a channel that varies less has no measurable lag

_NO_LIMITS = ChannelLimits()


@dataclass(frozen=True, slots=True, kw_only=True)
class BandCrossing:
    """An interval with differences outside the band."""

    begin_s: float
    end_s: float
    largest_difference: float
    largest_at_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class ChannelComparison:
    """One channel's difference, run minus reference, in its unit; `lag_s` is positive if the run is late."""

    column: TraceColumn
    limits: ChannelLimits
    rms: float
    peak_difference: float
    peak_at_s: float
    lag_s: float | None
    crossings: tuple[BandCrossing, ...]

    @property
    def exceeded_limits(self) -> tuple[str, ...]:
        values_and_limits = (
            ("rms", self.rms, self.limits.rms),
            ("max", abs(self.peak_difference), self.limits.max),
            ("lag", abs(self.lag_s or 0.0), self.limits.lag_s),
        )
        return tuple(
            name for name, value, limit in values_and_limits if limit is not None and value > limit + 1e-9
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class KeyFigureComparison:
    name: str
    reference_value: key_figures.FigureValue
    run_value: key_figures.FigureValue
    limit: float | None

    @property
    def difference(self) -> float:
        return key_figures.figure_difference(self.name, self.reference_value, self.run_value)

    @property
    def is_beyond_limit(self) -> bool:
        return self.limit is not None and self.difference > self.limit + 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class TraceComparison:
    name: str
    channel_comparisons: tuple[ChannelComparison, ...]
    figure_comparisons: tuple[KeyFigureComparison, ...]

    @property
    def is_within_tolerance(self) -> bool:
        return not any(result.exceeded_limits for result in self.channel_comparisons) and not any(
            result.is_beyond_limit for result in self.figure_comparisons
        )


def compare_trace(
    reference: ReferenceTrace,
    trace: dict[str, np.ndarray],
    tolerances: Tolerances,
    *,
    free_road: bool = False,
) -> TraceComparison:
    """Compare a recorded trace (100 Hz) with its reference.

    On a `free_road`, the lead's speed is not compared. Raises ConfigError if the two cover different times,
    or the reference lacks a limited channel.
    """
    run_channels = comparable_channels(trace)
    _check_same_duration(reference, len(trace["t"]))
    _check_limited_channels(reference, tolerances)
    skipped = ("v_lead",) if free_road else ()
    return TraceComparison(
        name=reference.name,
        channel_comparisons=tuple(
            _compare_channel(
                column, reference, run_channels, tolerances.channel_limits.get(column.channel, _NO_LIMITS)
            )
            for column in COLUMN_BY_CHANNEL.values()
            if column.channel in reference.channels and column.channel not in skipped
        ),
        figure_comparisons=_compare_key_figures(reference, run_channels, tolerances.figure_limits),
    )


def _check_same_duration(reference: ReferenceTrace, steps: int) -> None:
    last, period = int(reference.steps[-1]), int(reference.steps[-1] - reference.steps[-2])
    # The run continues after the last row of the reference, but not for a whole period.
    if not last < steps <= last + period:
        end, run_end = last / STEPS_PER_SECOND, (steps - 1) / STEPS_PER_SECOND
        raise ConfigError(
            f"the last row is at {end:g} s",
            where=str(reference.path),
            expected=f"a trace that ends with the run, at {run_end:g} s",
            remedy="compare whole runs of the same scenario",
        )


def _check_limited_channels(reference: ReferenceTrace, tolerances: Tolerances) -> None:
    channels_by_limit = {name: (name,) for name in tolerances.channel_limits}
    channels_by_limit |= {name: key_figures.CHANNELS_BY_FIGURE[name] for name in tolerances.figure_limits}
    for limited, channels in channels_by_limit.items():
        for channel in channels:
            values = reference.channels.get(channel)
            if values is None or not np.isfinite(values).any():
                raise ConfigError(
                    f"{'no' if values is None else 'nothing in'} column {COLUMN_BY_CHANNEL[channel].name!r}",
                    where=str(reference.path),
                    line=1,
                    expected=f"its values, because {limited} has a tolerance",
                    remedy="record it, or remove the tolerance",
                )


def _compare_key_figures(
    reference: ReferenceTrace, run_channels: dict[str, np.ndarray], limits: dict[str, float]
) -> tuple[KeyFigureComparison, ...]:
    """Use the reference's rows for both; only the run's time of engaging uses every step."""
    reference_values = key_figures.compute_key_figures(reference.steps, reference.channels)
    run_rows = {name: values[reference.steps] for name, values in run_channels.items()}
    run_values = key_figures.compute_key_figures(reference.steps, run_rows)
    all_steps = np.arange(len(run_channels["engaged"]))
    run_values["engaged_s"] = key_figures.compute_key_figures(
        all_steps, {"engaged": run_channels["engaged"]}
    )["engaged_s"]
    return tuple(
        KeyFigureComparison(
            name=name, reference_value=value, run_value=run_values[name], limit=limits.get(name)
        )
        for name, value in reference_values.items()
    )


def _compare_channel(
    column: TraceColumn, reference: ReferenceTrace, run_channels: dict[str, np.ndarray], limits: ChannelLimits
) -> ChannelComparison:
    reference_values, run_values = reference.channels[column.channel], run_channels[column.channel]
    valid = np.isfinite(reference_values)
    if column.channel.startswith("lead_") and column.channel != "lead_status":
        valid &= _rows_where_both_have_a_lead(reference, run_channels)
    steps, reference_values = reference.steps[valid], reference_values[valid]
    # A message can become visible one step later than in the reference, so the better match counts.
    delays = (0, 1) if column.published else (0,)
    differences = min(
        (_differences_at_steps(column, reference_values, run_values, steps - delay) for delay in delays),
        key=_rms,
    )
    largest = int(np.argmax(np.abs(differences))) if differences.size else None
    seconds = steps / STEPS_PER_SECOND
    return ChannelComparison(
        column=column,
        limits=limits,
        rms=_rms(differences),
        peak_difference=0.0 if largest is None else float(differences[largest]),
        peak_at_s=0.0 if largest is None else float(seconds[largest]),
        lag_s=None if column.is_categorical else time_lag_s(steps, reference_values, run_values),
        crossings=()
        if limits.listing_threshold is None
        else find_crossings(seconds, differences, limits.listing_threshold),
    )


def _rows_where_both_have_a_lead(
    reference: ReferenceTrace, run_channels: dict[str, np.ndarray]
) -> np.ndarray:
    run_has_lead = run_channels["lead_status"][reference.steps] == 1
    return (
        run_has_lead & (reference.channels["lead_status"] == 1)
        if "lead_status" in reference.channels
        else run_has_lead
    )


def _differences_at_steps(
    column: TraceColumn, reference_values: np.ndarray, run_channel: np.ndarray, steps: np.ndarray
) -> np.ndarray:
    """The run at `steps` minus the reference: 0 or 1 for categories, infinite if the run has NaN.

    Only the headway can be infinite, at standstill; then it is not compared.
    """
    run_values = run_channel[np.maximum(steps, 0)]
    if column.is_categorical:
        return (run_values != reference_values).astype(float)
    difference = np.where(np.isfinite(run_values), run_values, reference_values) - reference_values
    return difference if column.channel == "hwt" else np.where(np.isfinite(run_values), difference, inf)


def _rms(differences: np.ndarray) -> float:
    return float(np.sqrt(np.mean(differences**2))) if differences.size else 0.0


def find_crossings(seconds: np.ndarray, differences: np.ndarray, band: float) -> tuple[BandCrossing, ...]:
    outside = np.abs(differences) > band + 1e-9
    edges = np.flatnonzero(np.diff(np.concatenate(([0], outside.astype(int), [0]))))
    crossings = []
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        largest = begin + int(np.argmax(np.abs(differences[begin:end])))
        crossings.append(
            BandCrossing(
                begin_s=float(seconds[begin]),
                end_s=float(seconds[end - 1]),
                largest_difference=float(differences[largest]),
                largest_at_s=float(seconds[largest]),
            )
        )
    return tuple(crossings)


def time_lag_s(steps: np.ndarray, reference: np.ndarray, run_channel: np.ndarray) -> float | None:
    """The channel's delay behind the reference (s, at most 1): the shift with the highest correlation.

    None if a channel hardly varies. Of similarly good shifts, the smallest is used, because a steady slope
    fits any shift.
    """
    dissimilarity_by_shift: dict[int, float] = {}  # 1 minus correlation, by shift
    for shift in sorted(range(-_MOST_LAG_STEPS, _MOST_LAG_STEPS + 1), key=abs):
        inside = (steps + shift >= 0) & (steps + shift < len(run_channel))
        run_values, reference_values = run_channel[steps[inside] + shift], reference[inside]
        finite = np.isfinite(run_values)
        correlation = _correlation(run_values[finite], reference_values[finite])
        if correlation is not None:
            dissimilarity_by_shift[shift] = 1.0 - correlation
    if not dissimilarity_by_shift:
        return None
    # A tenth more dissimilarity than the best is treated as equal; 1e-9 allows for rounding near zero.
    similarly_good = 1.1 * min(dissimilarity_by_shift.values()) + 1e-9
    return (
        next(
            shift
            for shift, dissimilarity in dissimilarity_by_shift.items()
            if dissimilarity <= similarly_good
        )
        / STEPS_PER_SECOND
    )


def _correlation(a: np.ndarray, b: np.ndarray) -> float | None:
    if a.size < 3 or np.ptp(a) < _MIN_VARIATION or np.ptp(b) < _MIN_VARIATION:
        return None
    a, b = a - a.mean(), b - b.mean()
    return float(a @ b / np.sqrt((a @ a) * (b @ b)))
