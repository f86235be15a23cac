"""A group's results in a run: counts by outcome, a typical experiment and the worst one."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING

from mutator.model import Fault, Outcome, Status
from mutator.results.outcome_counting import UNUSABLE_ENDINGS, outcome_or_status_of_rows
from mutator.results.result_rows import ResultRow, rows_of
from mutator.results.table_reader import Results
from mutator.results.worst_first_ranking import worst_first_ranks
from mutator.review.mutant_groups import Group
from mutator.review.patch_shapes import group_label
from mutator.store import plan_file
from mutator.store.run_folder import RunFolder

if TYPE_CHECKING:
    import pandas as pd

_reading_lock = Lock()  # a page requests many groups of a run at once: read the table once
_TEXT_BY_OUTCOME = {
    Outcome.NOT_ACTIVATED.value: "not activated: the injected lines never ran while the trigger held",
    Outcome.MASKED.value: "masked: no actuator differed from the golden run",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class ExampleExperiment:
    id: str
    label: str
    ending: str
    verdict: str


@dataclass(frozen=True, slots=True, kw_only=True)
class GroupResults:
    """A group's results in a run. The typical experiment is the median, by rank, of those with the most
    frequent outcome; the worst has the first rank.
    """

    experiments: int
    outcomes: Mapping[str, int]
    typical: ExampleExperiment
    worst: ExampleExperiment


def results_of_group(run: RunFolder, group: Group) -> GroupResults | None:
    """Return the group's results in a run; None if the results table has no experiment of the group.
    MutatorError if the run has no table.
    """
    table = Results(run.path)
    try:
        table_mtime_ns = table.path.stat().st_mtime_ns
    except OSError:
        table_mtime_ns = 0  # reading the table reports the error
    with _reading_lock:
        return _results_by_label(run.path, table_mtime_ns).get(group.label)


@lru_cache(maxsize=8)
def _results_by_label(path: Path, table_mtime_ns: int) -> dict[str, GroupResults]:
    """Return the results of each group by label; `table_mtime_ns` is only a cache key."""
    import numpy as np

    frame = Results(path).frame()
    about = {hazard.name: hazard.about for hazard in RunFolder.open(path).head.about_hazards}
    faults = plan_file.load_faults(path)
    labels = {name: group_label(fault) for name, fault in faults.items()}
    label_by_row = [labels.get(name, "") for name in frame["fault_id"]]
    rows: dict[str, list[int]] = {}
    for row in np.argsort(worst_first_ranks(frame)).tolist():  # worst first
        rows.setdefault(label_by_row[row], []).append(row)
    ended = outcome_or_status_of_rows(frame).tolist()
    return {
        label: _build_results(frame, ended, group_rows, about, faults)
        for label, group_rows in rows.items()
        if label
    }


def _build_results(
    frame: "pd.DataFrame",
    ending_by_row: Sequence[str],
    rows: Sequence[int],
    meaning_by_hazard: Mapping[str, str],
    faults: Mapping[str, Fault],
) -> GroupResults:
    """Return the result for `rows`, sorted from worst to best. Of two equally frequent outcomes, the worse
    one is typical.
    """
    by_ending: dict[str, list[int]] = {}
    for row in rows:
        by_ending.setdefault(ending_by_row[row], []).append(row)
    usable = {
        name: ending_rows for name, ending_rows in by_ending.items() if name not in UNUSABLE_ENDINGS
    } or by_ending
    most = max(usable.values(), key=len)
    order = [*Outcome, *Status]
    counts = {name.value: len(by_ending[name.value]) for name in order if name.value in by_ending}
    chosen = rows_of(frame.iloc[[most[len(most) // 2], rows[0]]], faults)
    typical, worst = (_build_example(row, meaning_by_hazard) for row in chosen)
    return GroupResults(experiments=len(rows), outcomes=counts, typical=typical, worst=worst)


def _build_example(row: ResultRow, meaning_by_hazard: Mapping[str, str]) -> ExampleExperiment:
    return ExampleExperiment(
        id=row.experiment_id,
        label=f"{row.fault}, {row.scenario_label}, {row.trigger}",
        ending=row.ending,
        verdict=describe_result(row, meaning_by_hazard),
    )


def describe_result(row: ResultRow, meaning_by_hazard: Mapping[str, str]) -> str:
    """Return an experiment's result as text; `hazard_meanings` explain the hazards."""
    if row.ending in _TEXT_BY_OUTCOME:
        return _TEXT_BY_OUTCOME[row.ending]
    if row.ending == Outcome.SDC.value:
        return f"sdc: an actuator first differed from the golden run at {row.t_manifest:.2f} s; no hazard"
    if row.ending != Outcome.HAZARD.value:
        return f"{row.ending.replace('_', ' ')}: {row.detail}"
    name, time = row.hazards[0]
    meaning = f" ({meaning_by_hazard[name]})" if meaning_by_hazard.get(name) else ""
    after = f", {time - row.t_activation:.2f} s after activation" if row.t_activation is not None else ""
    alert_text = f"alert {row.alerts[0]} at {row.t_alert:.2f} s" if row.alerts else "no alert"
    return f"hazard {name}{meaning} at {time:.2f} s{after}; {alert_text}"
