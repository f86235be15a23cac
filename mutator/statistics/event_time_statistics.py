"""Propagation times: from activation to effects, and from the first alert to the first hazard.

Times from alert to hazard are censored, because a hazard might have followed after the end of the run. The
Kaplan-Meier estimate uses such runs up to their end; a mean over the other runs would be too short.
"""

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from mutator.statistics.results_frame import hazard_names
from mutator.statistics.shares_with_intervals import CONFIDENCE_LEVEL, Share
from mutator.statistics.weighted_shares import share_of_runs

if TYPE_CHECKING:
    import pandas as pd

FirstAlertsByHazardRun = Mapping[str, tuple[tuple[str, float], ...]]
_SHARE_TOLERANCE = (
    1e-9  # shares closer than this are equal, because a curve is a product of rounded fractions
)


@dataclass(frozen=True, slots=True, kw_only=True)
class TimeSpread:
    """The mean and quartiles of `n` times in s. NaN if there are none."""

    time_count: int
    mean: float
    lower_quartile: float
    median: float
    upper_quartile: float


@dataclass(frozen=True, slots=True, kw_only=True)
class AlertToHazardTimes:
    """Times (s) and shares from the first alert to a hazard. NaN: not reached or not defined.

    `runs_alerted_first` is the number of runs with an alert before any hazard. Of these,
    `hazards_after_alert` then had a hazard; the others are censored at their end. `median_s` is the time at
    which the Kaplan-Meier curve crosses one half. If the curve is flat at one half, `median_s` is the middle
    of the flat section, as in R's `survfit` and SAS; if the flat section reaches the end of the curve,
    `median_s` is the section's beginning. From `median_low_s` to `median_high_s`, the curve's log-log
    transformed interval contains one half (Brookmeyer and Crowley 1982). A bound is infinite if the runs do
    not reach it. `no_hazard_share` is the Kaplan-Meier share of alerts without a hazard within the driver's
    reaction time; `late_hazard_share` is the share, among the hazards after an alert, of those that came
    later than this reaction time.
    """

    runs_alerted_first: int
    hazards_after_alert: int
    median_s: float
    median_low_s: float
    median_high_s: float
    no_hazard_share: float
    late_hazard_share: Share
    runs_alerted_too_late: (
        int  # runs with the first alert after the first hazard; no other number includes them
    )


def spread_of_times(times: "pd.Series") -> TimeSpread:
    present = times.dropna()
    if present.empty:
        return TimeSpread(
            time_count=0, mean=math.nan, lower_quartile=math.nan, median=math.nan, upper_quartile=math.nan
        )
    lower, median, upper = (float(present.quantile(q)) for q in (0.25, 0.5, 0.75))
    return TimeSpread(
        time_count=len(present),
        mean=float(present.mean()),
        lower_quartile=lower,
        median=median,
        upper_quartile=upper,
    )


def share_of_hazards_within(frame: "pd.DataFrame", time_s: float) -> Share:
    """Return the share, among the runs with a hazard after the activation, of those whose first hazard came
    no later than `time_s` after it.
    """
    times = frame["time_to_hazard"]
    return share_of_runs(frame, times.round(6) <= time_s, times.notna())


def propagation_spreads_by_step(frame: "pd.DataFrame") -> dict[str, TimeSpread]:
    """Return the times from activation to the first actuator difference, alert and hazard, and from the first
    alert to the first hazard if the alert came first.
    """
    start = frame["t_activation"]
    reaction = frame["t_hazard"] - frame["t_alert"]
    return {
        "activation to manifest": spread_of_times(frame["t_manifest"] - start),
        "activation to alert": spread_of_times(frame["t_alert"] - start),
        "activation to hazard": spread_of_times(frame["t_hazard"] - start),
        "alert to hazard": spread_of_times(reaction[_alert_first_flags(frame)]),
    }


def alert_to_hazard_times(
    frame: "pd.DataFrame", end_by_scenario: Mapping[str, float], driver_reaction_s: float
) -> AlertToHazardTimes:
    """Return the Kaplan-Meier estimate (statsmodels) over the runs with an alert before any hazard.

    `end_by_scenario` has the end of each scenario's runs, in simulated seconds. Crashed and timed-out runs
    are left out, because their ends are unknown.
    """
    from statsmodels.duration.survfunc import SurvfuncRight  # type: ignore[import-untyped]

    alerted = frame[frame["is_alert"] & (frame["status"] == "ok")]
    first = alerted[~alerted["is_hazard"] | _alert_first_flags(alerted)]
    status = first["is_hazard"].astype(int)
    times = first["t_hazard"].fillna(first["scenario"].map(end_by_scenario)) - first["t_alert"]
    # rounded, so that a hazard exactly at the driver's reaction time is not later
    late = times.round(6) > driver_reaction_s
    events = int(status.sum())
    counts = {
        "runs_alerted_first": len(first),
        "hazards_after_alert": events,
        "runs_alerted_too_late": len(alerted) - len(first),
    }
    late_hazards = share_of_runs(first, late, first["is_hazard"])
    if not events:
        nan = math.nan
        no_hazard_share = 1.0 if len(first) else nan
        return AlertToHazardTimes(
            **counts,
            median_s=nan,
            median_low_s=nan,
            median_high_s=nan,
            no_hazard_share=no_hazard_share,
            late_hazard_share=late_hazards,
        )
    curve = SurvfuncRight(times.to_numpy().round(6), status.to_numpy())
    reached = curve.surv_prob[curve.surv_times <= driver_reaction_s]
    low, high = _median_time_interval(curve)
    return AlertToHazardTimes(
        **counts,
        median_s=_median_time(curve),
        median_low_s=low,
        median_high_s=high,
        no_hazard_share=float(reached[-1]) if len(reached) else 1.0,
        late_hazard_share=late_hazards,
    )


def _median_time(curve: Any) -> float:
    """Return the time at which a Kaplan-Meier curve crosses one half, as defined in `AlertToHazardTimes`; NaN
    if it does not.
    """
    (reached,) = np.nonzero(curve.surv_prob < 0.5 + _SHARE_TOLERANCE)
    if not reached.size:
        return math.nan
    first, *later = curve.surv_times[reached]
    is_flat = curve.surv_prob[reached[0]] > 0.5 - _SHARE_TOLERANCE
    return float((first + later[0]) / 2 if is_flat and later else first)


def _median_time_interval(curve: Any) -> tuple[float, float]:
    """Return the interval of the median time. Infinite or NaN: not reached."""
    with np.errstate(all="ignore"):  # the last point of the curve can be 0, which has no log
        low, high = curve.quantile_ci(0.5, alpha=1 - CONFIDENCE_LEVEL)
    # a curve that ends at 0 has no interval there, so the median's interval cannot end there
    is_open = high == curve.surv_times[-1] and curve.surv_prob[-1] < _SHARE_TOLERANCE
    return float(low), math.inf if is_open else float(high)


def alert_first_share_by_hazard_and_alert(
    frame: "pd.DataFrame", first_alerts_by_hazard_run: FirstAlertsByHazardRun
) -> dict[tuple[str, str], Share]:
    """Return, by (hazard, alert), the share of the runs with this hazard in which the alert came first. The
    names `any` and `none` mean at least one alert and no alert.

    `alerts_by_experiment` has the name and first time (s) of each alert of a run with a hazard.
    """
    import pandas as pd

    shares: dict[tuple[str, str], Share] = {}
    for hazard in hazard_names(frame):
        ends = frame[f"t_{hazard.lower()}"].dropna()
        runs = frame.loc[ends.index, "experiment_id"]
        before = [
            {name for name, t in first_alerts_by_hazard_run[run] if t < end}
            for run, end in zip(runs, ends, strict=True)
        ]
        names_before = pd.Series(before, index=ends.index, dtype=object)
        if before:
            by_name = {
                name: names_before.map(lambda names, name=name: name in names).astype(bool)
                for name in sorted(set().union(*before))
            }
            by_name["any"] = names_before.map(bool).astype(bool)
            by_name["none"] = ~by_name["any"]
            rows = frame.loc[ends.index]
            shares |= {
                (hazard, name): share_of_runs(rows, flags, flags | True) for name, flags in by_name.items()
            }
    return shares


def run_count_by_hazard_order(frame: "pd.DataFrame") -> dict[str, int]:
    """Return the number of runs with each order of hazards: `A`, `A then B`, `A with B`."""
    names = hazard_names(frame)
    rows = frame[frame["is_hazard"]]
    times = zip(*(rows[f"t_{name.lower()}"].tolist() for name in names), strict=True)
    orders = Counter(_describe_order(dict(zip(names, row, strict=True))) for row in times)
    return dict(sorted((order, count) for order, count in orders.items() if order))


def _describe_order(times: Mapping[str, float]) -> str:
    sorted_times = sorted((t, hazard) for hazard, t in times.items() if not math.isnan(t))
    text = sorted_times[0][1] if sorted_times else ""
    for (before, _), (t, hazard) in pairwise(sorted_times):
        text += f" {'with' if t == before else 'then'} {hazard}"
    return text


def _alert_first_flags(frame: "pd.DataFrame") -> "pd.Series":
    """Whether an alert came before the first hazard. An alert at the same time is no warning."""
    return frame["t_alert"] < frame["t_hazard"]
