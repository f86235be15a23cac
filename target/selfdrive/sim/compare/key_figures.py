"""Key figures of a run."""

from math import inf, isnan

import numpy as np

from selfdrive.common.conversions import MS_TO_KPH
from selfdrive.sim.compare.trace_csv import STEPS_PER_SECOND

FIGURE_MEANINGS = {
    "engaged_s": "the time of engaging in s; for a trace with gaps, the span that contains it",
    "set_speeds_kph": "the set speeds while engaged in km/h, in order",
    "min_hwt_s": "the smallest headway time while moving, in s",
    "min_d_rel_m": "the smallest distance to the lead in m",
    "max_brake": "the hardest braking command",
}

CHANNELS_BY_FIGURE = {  # the channels of each figure
    "engaged_s": ("engaged",),
    "set_speeds_kph": ("engaged", "v_cruise"),
    "min_hwt_s": ("v_ego", "hwt"),
    "min_d_rel_m": ("d_rel",),
    "max_brake": ("brake",),
}

_STANDSTILL_SPEED = 0.3  # m/s; below this the headway is meaningless

FigureValue = float | tuple[float, ...] | None


def compute_key_figures(steps: np.ndarray, channels: dict[str, np.ndarray]) -> dict[str, FigureValue]:
    """The key figures (`FIGURE_MEANINGS`) of channels with rows at `steps`; None for missing events."""
    function_by_figure = {
        "engaged_s": lambda engaged: _engaging_span(steps, engaged),
        "set_speeds_kph": _set_speeds,
        "min_hwt_s": lambda v_ego, hwt: _least_finite(hwt[v_ego >= _STANDSTILL_SPEED]),
        "min_d_rel_m": _least_finite,
        "max_brake": _greatest_finite,
    }
    return {
        name: function_by_figure[name](*(channels[channel] for channel in channel_names))
        for name, channel_names in CHANNELS_BY_FIGURE.items()
        if all(channel in channels for channel in channel_names)
    }


def figure_difference(name: str, reference_value: FigureValue, run_value: FigureValue) -> float:
    """The difference of two values of figure `name`; infinite if only one exists.

    Engaging: the distance between the two spans. Set speeds: 0 if the lists are equal, else the largest
    difference of a pair, infinite if one list is longer.
    """
    if reference_value is None or run_value is None:
        return 0.0 if reference_value is run_value else inf
    if name == "engaged_s":
        return max(0.0, reference_value[0] - run_value[1], run_value[0] - reference_value[1])
    if name == "set_speeds_kph":
        if len(reference_value) != len(run_value):
            return inf
        return max((abs(a - b) for a, b in zip(reference_value, run_value, strict=True)), default=0.0)
    return abs(run_value - reference_value)


def figure_text(name: str, value: FigureValue) -> str:
    if value is None:
        return "never"
    if name == "engaged_s":
        earliest, latest = value
        return f"{latest:.2f}" if earliest == latest else f"{earliest:.2f}..{latest:.2f}"
    if name == "set_speeds_kph":
        return " ".join(f"{speed:g}" for speed in value) or "none"
    return f"{value:.3f}"


def _engaging_span(steps: np.ndarray, engaged: np.ndarray) -> tuple[float, float] | None:
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
        speed_kph = round(float(speed) * MS_TO_KPH, 2)
        if not isnan(speed_kph) and (not speeds or speed_kph != speeds[-1]):
            speeds.append(speed_kph)
    return tuple(speeds)


def _least_finite(values: np.ndarray) -> float | None:
    finite = values[np.isfinite(values)]
    return float(finite.min()) if finite.size else None


def _greatest_finite(values: np.ndarray) -> float | None:
    finite = values[np.isfinite(values)]
    return float(finite.max()) if finite.size else None
