"""Key figures of a run."""

from math import inf, isnan

import numpy as np

from selfdrive.common.conversions import MS_TO_KPH
from selfdrive.sim.compare.trace_csv import STEPS_PER_SECOND

FIGURES = {
    "engaged_s": "the time of engaging in s; for a trace with gaps, the span that contains it",
    "set_speeds_kph": "the set speeds while engaged in km/h, in order",
    "min_hwt_s": "the smallest headway time while moving, in s",
    "min_d_rel_m": "the smallest distance to the lead in m",
    "max_brake": "the hardest braking command",
}

CHANNELS = {  # the channels of each figure
    "engaged_s": ("engaged",),
    "set_speeds_kph": ("engaged", "v_cruise"),
    "min_hwt_s": ("v_ego", "hwt"),
    "min_d_rel_m": ("d_rel",),
    "max_brake": ("brake",),
}

_STANDSTILL = 0.3  # m/s; below this the headway is meaningless

Value = float | tuple[float, ...] | None


def key_figures(steps: np.ndarray, channels: dict[str, np.ndarray]) -> dict[str, Value]:
    """The key figures (`FIGURES`) of channels with rows at `steps`; None for missing events."""
    read = {
        "engaged_s": lambda engaged: _engaging(steps, engaged),
        "set_speeds_kph": _set_speeds,
        "min_hwt_s": lambda v_ego, hwt: _least(hwt[v_ego >= _STANDSTILL]),
        "min_d_rel_m": _least,
        "max_brake": _greatest,
    }
    return {
        name: read[name](*(channels[channel] for channel in needed))
        for name, needed in CHANNELS.items()
        if all(channel in channels for channel in needed)
    }


def difference(name: str, reference: Value, ours: Value) -> float:
    """The difference of two values of figure `name`; infinite if only one exists.

    Engaging: the distance between the two spans. Set speeds: 0 if the lists are equal, else the largest
    difference of a pair, infinite if one list is longer.
    """
    if reference is None or ours is None:
        return 0.0 if reference is ours else inf
    if name == "engaged_s":
        return max(0.0, reference[0] - ours[1], ours[0] - reference[1])
    if name == "set_speeds_kph":
        if len(reference) != len(ours):
            return inf
        return max((abs(a - b) for a, b in zip(reference, ours, strict=True)), default=0.0)
    return abs(ours - reference)


def text(name: str, value: Value) -> str:
    if value is None:
        return "never"
    if name == "engaged_s":
        earliest, latest = value
        return f"{latest:.2f}" if earliest == latest else f"{earliest:.2f}..{latest:.2f}"
    if name == "set_speeds_kph":
        return " ".join(f"{speed:g}" for speed in value) or "none"
    return f"{value:.3f}"


def _engaging(steps: np.ndarray, engaged: np.ndarray) -> tuple[float, float] | None:
    """The span from the row before the first engaged one to that row; empty for a single step."""
    rows = np.flatnonzero(engaged == 1.0)
    if not rows.size:
        return None
    latest = int(steps[rows[0]])
    earliest = int(steps[rows[0] - 1]) if rows[0] else latest
    if latest - earliest == 1:
        earliest = latest
    return earliest / STEPS_PER_SECOND, latest / STEPS_PER_SECOND


def _set_speeds(engaged: np.ndarray, set_speed: np.ndarray) -> tuple[float, ...]:
    speeds: list[float] = []
    for speed in set_speed[engaged == 1.0]:
        shown = round(float(speed) * MS_TO_KPH, 2)
        if not isnan(shown) and (not speeds or shown != speeds[-1]):
            speeds.append(shown)
    return tuple(speeds)


def _least(values: np.ndarray) -> float | None:
    finite = values[np.isfinite(values)]
    return float(finite.min()) if finite.size else None


def _greatest(values: np.ndarray) -> float | None:
    finite = values[np.isfinite(values)]
    return float(finite.max()) if finite.size else None
