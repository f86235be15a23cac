"""Compares a trace with its reference by channel."""

from dataclasses import dataclass
from math import inf

import numpy as np

from selfdrive.common.errors import ConfigError
from selfdrive.sim.compare import key_figures
from selfdrive.sim.compare.tolerances import Limits, Tolerances
from selfdrive.sim.compare.trace_csv import BY_CHANNEL, STEPS_PER_SECOND, Column, Reference, channels_of

_LONGEST_LAG = 100  # steps, that is 1 s
_STEADY = 1e-6  # a channel that varies less has no measurable lag

_NOTHING = Limits()


@dataclass(frozen=True, slots=True, kw_only=True)
class Crossing:
    """An interval (s) with differences outside the band; `worst` is the largest, at `at` s."""

    begin: float
    end: float
    worst: float
    at: float


@dataclass(frozen=True, slots=True, kw_only=True)
class ChannelResult:
    """One channel's difference, ours minus reference, in its unit; `lag` (s) is positive if ours is late."""

    column: Column
    limits: Limits
    rms: float
    largest: float
    at: float
    lag: float | None
    crossings: tuple[Crossing, ...]

    @property
    def failures(self) -> tuple[str, ...]:
        found = (
            ("rms", self.rms, self.limits.rms),
            ("max", abs(self.largest), self.limits.max),
            ("lag", abs(self.lag or 0.0), self.limits.lag),
        )
        return tuple(name for name, value, limit in found if limit is not None and value > limit + 1e-9)


@dataclass(frozen=True, slots=True, kw_only=True)
class FigureResult:
    name: str
    reference: key_figures.Value
    ours: key_figures.Value
    limit: float | None

    @property
    def difference(self) -> float:
        return key_figures.difference(self.name, self.reference, self.ours)

    @property
    def failed(self) -> bool:
        return self.limit is not None and self.difference > self.limit + 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    name: str
    channels: tuple[ChannelResult, ...]
    figures: tuple[FigureResult, ...]

    @property
    def good(self) -> bool:
        return not any(result.failures for result in self.channels) and not any(
            result.failed for result in self.figures
        )


def compare(
    reference: Reference, trace: dict[str, np.ndarray], tolerances: Tolerances, *, free_road: bool = False
) -> Comparison:
    """Compare a recorded trace (100 Hz) with its reference.

    On a `free_road`, the lead's speed is not compared. Raises ConfigError if the two cover different times,
    or the reference lacks a limited channel.
    """
    ours = channels_of(trace)
    _same_time(reference, len(trace["t"]))
    _complete(reference, tolerances)
    skipped = ("v_lead",) if free_road else ()
    return Comparison(
        name=reference.name,
        channels=tuple(
            _channel(column, reference, ours, tolerances.channels.get(column.channel, _NOTHING))
            for column in BY_CHANNEL.values()
            if column.channel in reference.channels and column.channel not in skipped
        ),
        figures=_figures(reference, ours, tolerances.figures),
    )


def _same_time(reference: Reference, steps: int) -> None:
    last, period = int(reference.steps[-1]), int(reference.steps[-1] - reference.steps[-2])
    if not last < steps <= last + period:
        end, run_end = last / STEPS_PER_SECOND, (steps - 1) / STEPS_PER_SECOND
        raise ConfigError(
            f"the last row is at {end:g} s",
            where=str(reference.path),
            expected=f"a trace that ends with the run, at {run_end:g} s",
            remedy="compare whole runs of the same scenario",
        )


def _complete(reference: Reference, tolerances: Tolerances) -> None:
    needed = {name: (name,) for name in tolerances.channels}
    needed |= {name: key_figures.CHANNELS[name] for name in tolerances.figures}
    for limited, channels in needed.items():
        for channel in channels:
            values = reference.channels.get(channel)
            if values is None or not np.isfinite(values).any():
                raise ConfigError(
                    f"{'no' if values is None else 'nothing in'} column {BY_CHANNEL[channel].name!r}",
                    where=str(reference.path),
                    line=1,
                    expected=f"its values, because {limited} has a tolerance",
                    remedy="record it, or remove the tolerance",
                )


def _figures(
    reference: Reference, ours: dict[str, np.ndarray], limits: dict[str, float]
) -> tuple[FigureResult, ...]:
    """Use the reference's rows for both; only our time of engaging uses every step."""
    theirs = key_figures.key_figures(reference.steps, reference.channels)
    rows = {name: values[reference.steps] for name, values in ours.items()}
    mine = key_figures.key_figures(reference.steps, rows)
    every = np.arange(len(ours["engaged"]))
    mine["engaged_s"] = key_figures.key_figures(every, {"engaged": ours["engaged"]})["engaged_s"]
    return tuple(
        FigureResult(name=name, reference=value, ours=mine[name], limit=limits.get(name))
        for name, value in theirs.items()
    )


def _channel(
    column: Column, reference: Reference, ours: dict[str, np.ndarray], limits: Limits
) -> ChannelResult:
    theirs, channel = reference.channels[column.channel], ours[column.channel]
    valid = np.isfinite(theirs)
    if column.channel.startswith("lead_") and column.channel != "lead_status":
        valid &= _both_see_a_lead(reference, ours)
    steps, theirs = reference.steps[valid], theirs[valid]
    delays = (0, 1) if column.published else (0,)
    found = min((_differences(column, theirs, channel, steps - delay) for delay in delays), key=_rms)
    worst = int(np.argmax(np.abs(found))) if found.size else None
    seconds = steps / STEPS_PER_SECOND
    return ChannelResult(
        column=column,
        limits=limits,
        rms=_rms(found),
        largest=0.0 if worst is None else float(found[worst]),
        at=0.0 if worst is None else float(seconds[worst]),
        lag=None if column.exclusive else time_lag(steps, theirs, channel),
        crossings=() if limits.band is None else crossings(seconds, found, limits.band),
    )


def _both_see_a_lead(reference: Reference, ours: dict[str, np.ndarray]) -> np.ndarray:
    seen = ours["lead_status"][reference.steps] == 1
    return seen & (reference.channels["lead_status"] == 1) if "lead_status" in reference.channels else seen


def _differences(column: Column, theirs: np.ndarray, channel: np.ndarray, steps: np.ndarray) -> np.ndarray:
    """Ours at `steps` minus the reference: 0 or 1 for exclusive values, infinite if ours is NaN.

    Only the headway can be infinite, at standstill; then it is not compared.
    """
    ours = channel[np.maximum(steps, 0)]
    if column.exclusive:
        return (ours != theirs).astype(float)
    difference = np.where(np.isfinite(ours), ours, theirs) - theirs
    return difference if column.channel == "hwt" else np.where(np.isfinite(ours), difference, inf)


def _rms(differences: np.ndarray) -> float:
    return float(np.sqrt(np.mean(differences**2))) if differences.size else 0.0


def crossings(seconds: np.ndarray, differences: np.ndarray, band: float) -> tuple[Crossing, ...]:
    outside = np.abs(differences) > band + 1e-9
    edges = np.flatnonzero(np.diff(np.concatenate(([0], outside.astype(int), [0]))))
    found = []
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        worst = begin + int(np.argmax(np.abs(differences[begin:end])))
        found.append(
            Crossing(
                begin=float(seconds[begin]),
                end=float(seconds[end - 1]),
                worst=float(differences[worst]),
                at=float(seconds[worst]),
            )
        )
    return tuple(found)


def time_lag(steps: np.ndarray, reference: np.ndarray, channel: np.ndarray) -> float | None:
    """The channel's delay behind the reference (s, at most 1): the shift with the highest correlation.

    None if a channel hardly varies. Of similarly good shifts, the smallest is used, because a steady slope
    fits any shift.
    """
    apart: dict[int, float] = {}  # 1 minus correlation, by shift
    for shift in sorted(range(-_LONGEST_LAG, _LONGEST_LAG + 1), key=abs):
        inside = (steps + shift >= 0) & (steps + shift < len(channel))
        ours, theirs = channel[steps[inside] + shift], reference[inside]
        finite = np.isfinite(ours)
        correlation = _correlation(ours[finite], theirs[finite])
        if correlation is not None:
            apart[shift] = 1.0 - correlation
    if not apart:
        return None
    good = 1.1 * min(apart.values()) + 1e-9
    return next(shift for shift, missing in apart.items() if missing <= good) / STEPS_PER_SECOND


def _correlation(a: np.ndarray, b: np.ndarray) -> float | None:
    if a.size < 3 or np.ptp(a) < _STEADY or np.ptp(b) < _STEADY:
        return None
    a, b = a - a.mean(), b - b.mean()
    return float(a @ b / np.sqrt((a @ a) * (b @ b)))
