"""What the page shows first: the worst experiment in words, four numbers with their intervals, and the change
against the run before.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from math import isnan
from typing import TYPE_CHECKING

from mutator._common.message_text import counted, rounded_percent
from mutator.model import Record
from mutator.report.answer_parts import ALERT_BEFORE_HAZARD, SILENT_HAZARD_WARNINGS, filtered_list_fragment
from mutator.report.reported_run import ReportedRun
from mutator.results.experiment_sentence import ExperimentSentences
from mutator.results.result_rows import ResultRow, rows_of
from mutator.statistics.bootstrap_median_intervals import median_interval
from mutator.statistics.weighted_shares import share_of_runs

if TYPE_CHECKING:
    import pandas as pd

MOST_LISTED_CHANGES = 3  # maximum number of new hazards, and of those gone, that are listed


@dataclass(frozen=True, slots=True, kw_only=True)
class KeyNumber:
    """One number of the first screen: `value` is the number, `meaning` the sentence that it begins,
    `evidence` its counts and its 95 % interval. `fragment` opens the list of what it counts; '' if there is
    nothing to list. `percents` has the rate and the ends of its interval for the drawing; None for a time.
    """

    value: str
    meaning: str
    evidence: str
    fragment: str
    percents: tuple[float, float, float] | None = None


def worst_row(run: ReportedRun) -> ResultRow | None:
    """Return the worst usable experiment, with its sentence; None without one."""
    ranks = run.experiment_facts.worst_first_ranks
    if not len(ranks):
        return None
    worst = run.results.iloc[[int(ranks.argmin())]]
    [row] = rows_of(worst, run.faults, ExperimentSentences.of_run(run.folder.head))
    return row if row.usable else None


def worst_record(run: ReportedRun) -> Record | None:
    """Return the record of the worst usable experiment; None without one."""
    row = worst_row(run)
    return run.records.get(row.experiment_id) if row else None


def key_numbers(frame: "pd.DataFrame", *, has_alerts: bool) -> tuple[KeyNumber, ...]:
    """Return how many faults acted, how many of these led to a hazard, how many hazards were silent, and how
    soon the hazard came. `frame` has the usable experiments, with their `warning`. A target without alerts
    has the share of faults that changed an actuator instead of silent hazards.
    """
    every, active, hazard = frame["is_activated"] | True, frame["is_activated"], frame["outcome"] == "hazard"
    silent = hazard & (frame["warning"] != ALERT_BEFORE_HAZARD)
    share = partial(_share_number, frame)
    numbers = [
        share(active, every, "faults", "acted (activated)", query="t_activation>=0"),
        share(hazard, active, "activated faults", "led to a hazard", filters={"outcome": ["hazard"]}),
    ]
    if has_alerts:
        filters = {"warning": SILENT_HAZARD_WARNINGS}
        numbers.append(share(silent, hazard, "hazards", "came without an alert before", filters=filters))
    else:
        manifested = active & frame["is_manifested"]
        verb, query = "changed an actuator", "t_manifest>=0"
        numbers.append(share(manifested, active, "activated faults", verb, query=query))
    return (*numbers, _time_number(frame[hazard]))


def _share_number(
    frame: "pd.DataFrame",
    part: "pd.Series",
    whole: "pd.Series",
    plural_noun: str,
    verb: str,
    *,
    filters: Mapping[str, Sequence[str]] | None = None,
    query: str = "",
) -> KeyNumber:
    result = share_of_runs(frame, part, whole)
    meaning = f"of the {plural_noun} {verb}"
    if not result.of:
        return KeyNumber(value="-", meaning=meaning, evidence=f"there were no {plural_noun}", fragment="")
    fragment = filtered_list_fragment(filters or {"q": [query]}) if result.count else ""
    counts = f"{result.count:,} of {result.of:,}"
    if isnan(result.rate):
        return KeyNumber(
            value=counts, meaning=meaning, evidence="of those that ran; no rate of all", fragment=fragment
        )
    rate, low, high = (100 * value for value in (result.rate, result.low, result.high))
    drawn = "" if result.weighted_rate is None else " drawn; weighted"
    return KeyNumber(
        value=f"{rounded_percent(rate, 100)} %",
        meaning=meaning,
        evidence=f"{counts}{drawn}; 95 % interval {low:.0f} to {high:.0f} %",
        fragment=fragment,
        percents=(rate, low, high),
    )


def _time_number(hazards: "pd.DataFrame") -> KeyNumber:
    times = (hazards["t_hazard"] - hazards["t_activation"]).dropna().round(6)
    meaning = "from fault to hazard (median)"
    if times.empty:
        return KeyNumber(value="-", meaning=meaning, evidence="there were no hazards", fragment="")
    low, high = median_interval(times, hazards.loc[times.index, "fault_id"])
    interval = (
        "no interval: too few different faults" if isnan(low) else f"95 % interval {low:.2f} to {high:.2f} s"
    )
    return KeyNumber(
        value=f"{times.median():.2f} s",
        meaning=meaning,
        evidence=f"{interval}; {times.min():.2f} s at the soonest",
        fragment=filtered_list_fragment({"outcome": ["hazard"]}, "time_to_hazard"),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class DescribedChange:
    """The change against the run before, in words. `hazards` are the first new ones and those gone, each with
    its experiment in this run.
    """

    text: str
    advice: str
    hazards: tuple[tuple[str, ResultRow], ...]

    @property
    def markdown(self) -> str:
        hazards = [
            f"* {what}: {row.sentence or row.fault} (`{row.experiment_id}`)" for what, row in self.hazards
        ]
        return "\n".join((f"**Since the run before:** {self.text} {self.advice}", *hazards))


def describe_change(run: ReportedRun) -> DescribedChange | None:
    """Describe the change against the run before; None without one."""
    change = run.change
    if change is None:
        return None
    text = "no difference"
    if change.new_hazard_ids or change.former_hazard_ids or change.changed_count:
        text = f"{counted(len(change.new_hazard_ids), 'new hazard')}, "
        text += f"{len(change.former_hazard_ids):,} gone, {change.changed_count:,} changed otherwise"
    commit = "" if change.target_commit == "-" else f", target {change.target_commit}"
    text += f", of {change.shared_count:,} experiments that are also in {change.name} "
    text += f"({change.date} UTC{commit})."
    listed = {
        "new": change.new_hazard_ids[:MOST_LISTED_CHANGES],
        "gone": change.former_hazard_ids[:MOST_LISTED_CHANGES],
    }
    results = run.results[run.results["experiment_id"].isin([*listed["new"], *listed["gone"]])]
    rows = rows_of(results, run.faults, ExperimentSentences.of_run(run.folder.head))
    rows_by_id = {row.experiment_id: row for row in rows}
    command = f"mutator compare {change.name} {run.folder.path.resolve().name}"
    return DescribedChange(
        text=text,
        advice=f"Compare them, in the folder that has both: `{command}`.",
        hazards=tuple(
            (what, rows_by_id[name]) for what, names in listed.items() for name in names if name in rows_by_id
        ),
    )
