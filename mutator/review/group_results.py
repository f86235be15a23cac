"""A group's results in a run: counts by outcome, a typical experiment and the worst one."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING

from mutator.model import Fault, Outcome, Status
from mutator.results.outcome_counting import UNUSABLE_STATUSES, endings_of_rows
from mutator.results.ranking import ranks_of_rows
from mutator.results.result_rows import ResultRow, rows_of
from mutator.results.table_reader import Results
from mutator.review.mutant_groups import Group
from mutator.review.patch_shapes import group_label
from mutator.store import plan_file
from mutator.store.run_folder import RunFolder

if TYPE_CHECKING:
    import pandas as pd

_reading = Lock()  # a page requests many groups of a run at once: read the table once
_PLAIN = {
    Outcome.NOT_ACTIVATED.value: "not activated: the injected lines never ran while the trigger held",
    Outcome.MASKED.value: "masked: no actuator differed from the golden run",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    id: str
    label: str
    ending: str
    verdict: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Typical:
    """A group's results in a run. The typical experiment is the median, by rank, of those with the most
    frequent outcome; the worst has the first rank.
    """

    experiments: int
    outcomes: Mapping[str, int]
    typical: Case
    worst: Case


def of_group(run: RunFolder, group: Group) -> Typical | None:
    """Return the group's results in a run; None if the results table has no experiment of the group.
    MutatorError if the run has no table.
    """
    table = Results(run.path)
    try:
        written = table.path.stat().st_mtime_ns
    except OSError:
        written = 0  # reading the table reports the error
    with _reading:
        return _of_run(run.path, written).get(group.what)


@lru_cache(maxsize=8)
def _of_run(path: Path, written: int) -> dict[str, Typical]:
    """Return the results of each group by label; `written`, the time of the table, is only a cache key."""
    import numpy as np

    frame = Results(path).frame()
    about = {one.name: one.about for one in RunFolder.open(path).head.about_hazards}
    faults = plan_file.load_faults(path)
    labels = {name: group_label(fault) for name, fault in faults.items()}
    known = [labels.get(name, "") for name in frame["fault_id"]]
    rows: dict[str, list[int]] = {}
    for row in np.argsort(ranks_of_rows(frame)).tolist():  # worst first
        rows.setdefault(known[row], []).append(row)
    ended = endings_of_rows(frame).tolist()
    return {label: _typical(frame, ended, own, about, faults) for label, own in rows.items() if label}


def _typical(
    frame: "pd.DataFrame",
    ended: Sequence[str],
    rows: Sequence[int],
    about: Mapping[str, str],
    faults: Mapping[str, Fault],
) -> Typical:
    """Return the result for `rows`, sorted from worst to best. Of two equally frequent outcomes, the worse
    one is typical.
    """
    by_ending: dict[str, list[int]] = {}
    for row in rows:
        by_ending.setdefault(ended[row], []).append(row)
    usable = {name: own for name, own in by_ending.items() if name not in UNUSABLE_STATUSES} or by_ending
    most = max(usable.values(), key=len)
    order = [*Outcome, *Status]
    counts = {name.value: len(by_ending[name.value]) for name in order if name.value in by_ending}
    chosen = rows_of(frame.iloc[[most[len(most) // 2], rows[0]]], faults)
    typical, worst = (_case(row, about) for row in chosen)
    return Typical(experiments=len(rows), outcomes=counts, typical=typical, worst=worst)


def _case(row: ResultRow, about: Mapping[str, str]) -> Case:
    return Case(
        id=row.experiment_id,
        label=f"{row.fault}, {row.scenario}, {row.trigger}",
        ending=row.ending,
        verdict=verdict_of(row, about),
    )


def verdict_of(row: ResultRow, about: Mapping[str, str]) -> str:
    """Return an experiment's result as text; `about` explains the hazards."""
    if row.ending in _PLAIN:
        return _PLAIN[row.ending]
    if row.ending == Outcome.SDC.value:
        return f"sdc: an actuator first differed from the golden run at {row.t_manifest:.2f} s; no hazard"
    if row.ending != Outcome.HAZARD.value:
        return f"{row.ending.replace('_', ' ')}: {row.detail}"
    name, time = row.hazards[0]
    meaning = f" ({about[name]})" if about.get(name) else ""
    after = f", {time - row.t_activation:.2f} s after activation" if row.t_activation is not None else ""
    said = f"alert {row.alerts[0]} at {row.t_alert:.2f} s" if row.alerts else "no alert"
    return f"hazard {name}{meaning} at {time:.2f} s{after}; {said}"
