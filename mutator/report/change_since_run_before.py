"""The change against the run before: the latest earlier run of the same campaign and plan in the same folder.

It is found when a report is written, and stored beside the report as `run_before.json`, from which the report
can be built again without the other run. The seal does not cover it.
"""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from datetime import datetime
from typing import TYPE_CHECKING

from mutator._common.confined_files import read_below
from mutator._common.files import json_bytes, parse_json_object
from mutator._common.hashing import as_json_types
from mutator._common.typed_json import typed_value_from_json
from mutator.errors import MutatorError, TypeMisfit
from mutator.model import Outcome
from mutator.report.panel import REPORT_FOLDER
from mutator.report.run_history import end_of_last_experiment, run_folders, target_commit_of
from mutator.results.outcome_counting import outcome_or_status_of_rows
from mutator.results.table_reader import Results
from mutator.store.run_folder import RunFolder

if TYPE_CHECKING:
    from pandas import DataFrame, Series

RUN_BEFORE_FILE, RUN_BEFORE_SCHEMA = "run_before.json", "run-before/1"


@dataclass(frozen=True, slots=True, kw_only=True)
class ChangeSinceRunBefore:
    """What changed since the run `name`: the ids of experiments with a new hazard and of those whose hazard
    is gone, the number of those that changed otherwise, and of those in both runs.
    """

    name: str
    date: str  # of its last record, UTC
    target_commit: str
    new_hazard_ids: tuple[str, ...]
    former_hazard_ids: tuple[str, ...]
    changed_count: int
    shared_count: int

    def as_bytes(self) -> bytes:
        return json_bytes({"schema": RUN_BEFORE_SCHEMA, **as_json_types(self)})


def find_change(folder: RunFolder, results: "DataFrame") -> ChangeSinceRunBefore | None:
    """Compare a run with the run before; None without one that can be read."""
    ended = end_of_last_experiment(folder)
    before = _find_run_before(folder, ended) if ended else None
    if before is None:
        return None
    earlier, date = before
    try:
        endings = {
            "before": _ending_by_experiment(Results(earlier.path).frame()),
            "after": _ending_by_experiment(results),
        }
    except MutatorError:  # it has no results yet
        return None
    return _change_between(earlier, date, endings)


def _find_run_before(folder: RunFolder, ended: datetime) -> tuple[RunFolder, datetime] | None:
    candidates = []
    for path in run_folders(folder.path.resolve().parent):
        if path.name == folder.path.resolve().name:
            continue
        with suppress(MutatorError, LookupError, TypeError, ValueError):  # the other run is damaged
            other = RunFolder.open_unverified(path)
            is_alike = (other.head.campaign, other.head.plan) == (folder.head.campaign, folder.head.plan)
            if is_alike and (date := end_of_last_experiment(other)) and date < ended:
                candidates.append((date, path.name, other))
    if not candidates:
        return None
    date, _, other = max(candidates, key=lambda candidate: candidate[:2])
    return other, date


def _ending_by_experiment(results: "DataFrame") -> "Series[str]":
    return outcome_or_status_of_rows(results).set_axis(results["experiment_id"])


def _change_between(
    earlier: RunFolder, date: datetime, endings: Mapping[str, "Series[str]"]
) -> ChangeSinceRunBefore:
    import pandas as pd

    pairs = pd.concat(endings, axis=1, join="inner").sort_index()
    was_hazard, is_hazard = (pairs[name] == Outcome.HAZARD.value for name in ("before", "after"))
    return ChangeSinceRunBefore(
        name=earlier.path.name,
        date=f"{date:%Y-%m-%d %H:%M}",
        target_commit=target_commit_of(earlier),
        new_hazard_ids=tuple(map(str, pairs.index[is_hazard & ~was_hazard])),
        former_hazard_ids=tuple(map(str, pairs.index[was_hazard & ~is_hazard])),
        changed_count=int(((pairs["before"] != pairs["after"]) & ~was_hazard & ~is_hazard).sum()),
        shared_count=len(pairs),
    )


def stored_change(folder: RunFolder) -> ChangeSinceRunBefore | None:
    """Read the change that the stored report shows; None without one, or if it cannot be read."""
    path = folder.path / REPORT_FOLDER / RUN_BEFORE_FILE
    try:
        data = read_below(folder.path, f"{REPORT_FOLDER}/{RUN_BEFORE_FILE}")
        stored = parse_json_object(data, path, RUN_BEFORE_SCHEMA)
        return typed_value_from_json(ChangeSinceRunBefore, {k: v for k, v in stored.items() if k != "schema"})
    except (OSError, MutatorError, TypeMisfit):
        return None
