"""Tables of times, alerts and the order of hazards."""

from collections.abc import Iterator, Mapping
from dataclasses import astuple
from typing import TYPE_CHECKING

from mutator.results.outcome_counting import families_or_scenarios_of
from mutator.statistics import event_time_statistics
from mutator.statistics.published_counts import PublishedCounts
from mutator.statistics.statistics_sheet import Sheet, SheetCell

if TYPE_CHECKING:
    import pandas as pd

_ALERT_NOTE = (
    " Alert to hazard: only if the alert came first. Hazards that would follow after the end of the run are "
    "missing here; see the table *From alert to hazard, censored*."
)


def propagation_sheet(
    frame: "pd.DataFrame", published: PublishedCounts | None, *, has_alerts: bool = True
) -> Sheet:
    lines: list[tuple[SheetCell, ...]] = []
    for method, scenario, group in _groups_with_totals(frame):
        for step, spread in event_time_statistics.propagation_spreads_by_step(group).items():
            if has_alerts or "alert" not in step:
                lines.append((method, scenario, step, *astuple(spread)))
    return Sheet(
        name="propagation",
        title="Propagation times by scenario",
        note="Time in s between two events, in the N runs with both. Manifest: first difference of an "
        "actuator output from the fault-free run."
        + (_ALERT_NOTE if has_alerts else "")
        + (f" {published.times_note}" if published else ""),
        heads=(
            "method",
            "scenario",
            "time",
            "N",
            "mean, s",
            "lower quartile, s",
            "median, s",
            "upper quartile, s",
        ),
        lines=tuple(lines),
    )


def alert_to_hazard_sheet(
    frame: "pd.DataFrame", end_by_scenario: Mapping[str, float], driver_reaction_s: float
) -> Sheet:
    lines: list[tuple[SheetCell, ...]] = []
    for method, scenario, group in _groups_with_totals(frame):
        reaction = event_time_statistics.alert_to_hazard_times(group, end_by_scenario, driver_reaction_s)
        median: tuple[SheetCell, ...] = (reaction.median_s, reaction.median_low_s, reaction.median_high_s)
        counts = (
            reaction.runs_alerted_first,
            reaction.hazards_after_alert,
            reaction.runs_alerted_first - reaction.hazards_after_alert,
            reaction.runs_alerted_too_late,
        )
        lines.append(
            (method, scenario, *counts, *median, reaction.no_hazard_share, reaction.late_hazard_share)
        )
    reaction_text = f"{driver_reaction_s:g} s"
    return Sheet(
        name="alert_to_hazard",
        title="From alert to hazard, censored",
        note="The table covers runs whose first alert came before any hazard. Runs without a hazard are "
        "censored at their end. Median: Kaplan-Meier with its 95 % interval, `-` or `inf` if not reached; if "
        "the curve is flat at one half, the middle of the flat part. The last columns: the share of alerts "
        f"that no hazard follows within {reaction_text}, the driver's reaction time (Kaplan-Meier); and, of "
        f"the hazards that follow an alert, the share that come more than {reaction_text} later. Alerts with "
        "or after the first hazard are counted separately.",
        heads=(
            *("method", "scenario", "alerts first", "then hazard", "censored", "alert not before hazard"),
            *("median, s", "median, low, s", "median, high, s"),
            *(f"no hazard within {reaction_text}", f"hazards later than {reaction_text}"),
        ),
        lines=tuple(lines),
    )


def alerts_before_hazards_sheet(
    frame: "pd.DataFrame", first_alerts_by_hazard_run: event_time_statistics.FirstAlertsByHazardRun
) -> Sheet:
    lines: list[tuple[SheetCell, ...]] = []
    for method, group in frame.groupby("method"):
        shares = event_time_statistics.alert_first_share_by_hazard_and_alert(
            group, first_alerts_by_hazard_run
        )
        lines += [(str(method), hazard, alert, share) for (hazard, alert), share in shares.items()]
    return Sheet(
        name="alerts_before_hazards",
        title="Alerts before hazards",
        note="Runs with a hazard in which an alert came first, with 95 % Wilson intervals. "
        "A run with several alerts is in several lines. `any`: at least one alert; `none`: no alert.",
        heads=("method", "hazard", "alert", "came before it"),
        lines=tuple(lines),
    )


def hazard_orders_sheet(frame: "pd.DataFrame") -> Sheet:
    lines: list[tuple[SheetCell, ...]] = []
    for (method, module), group in frame.groupby(["method", "module"]):
        lines += [
            (str(method), str(module), order, n)
            for order, n in event_time_statistics.run_count_by_hazard_order(group).items()
        ]
    return Sheet(
        name="hazard_orders",
        title="Order of hazards",
        note="Runs with at least one hazard, by their hazards in order of first occurrence.",
        heads=("method", "module", "hazards", "N"),
        lines=tuple(lines),
    )


def _groups_with_totals(frame: "pd.DataFrame") -> Iterator[tuple[str, str, "pd.DataFrame"]]:
    """Yield the groups by method and scenario; scenarios of a family are one group. After the scenarios of a
    method comes its total.
    """
    for method, of_method in frame.groupby("method"):
        for scenario, group in of_method.groupby(families_or_scenarios_of(of_method)):
            yield str(method), str(scenario), group
        yield str(method), "total", of_method
