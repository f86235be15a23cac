"""Runs that a page watches: counts and the worst results so far, from the records as workers append them.

Every byte of a record is read once, when a page asks. What is shown is provisional: the equivalence check and
the seal come at the end.
"""

import threading
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path
from typing import Any

from mutator._common.hashing import parse_json
from mutator.errors import MutatorError, NotServed
from mutator.execution.progress_text import describe_duration, describe_rate
from mutator.model import Experiment, Outcome, Record, Status
from mutator.outcomes.verdict_rules import reaction_time
from mutator.results.experiment_sentence import ExperimentSentences
from mutator.results.finished_experiments_and_columns import FinishedExperiment
from mutator.results.result_rows import ResultRow, rows_of
from mutator.results.table_columns import result_columns_of
from mutator.results.table_reader import frame_of_finished
from mutator.results.worst_first_ranking import worst_first_ranks
from mutator.serve.run_states import RunState
from mutator.store.line_tail import LineTail
from mutator.store.planned_experiments import PlannedExperiments
from mutator.store.records import RECORDS_FOLDER, record_from_json
from mutator.store.run_folder import RunFolder
from mutator.store.run_progress import progress_label

MOST_ROWS = 100  # of the worst results
_MOST_BYTES_AT_ONCE = (
    2_000_000  # of each file of records; about 2,000 records, which take a fifth of a second
)
_MOST_WATCHED_RUNS = 4  # each has an index of its plan in memory
_version_numbers = count(1)


@dataclass(kw_only=True)
class _RunCounts:
    activated: int = 0
    silent: int = 0
    hazards: Counter[str] = field(default_factory=Counter)
    labels: Counter[str] = field(default_factory=Counter)  # outcomes or statuses

    def add(self, record: Record) -> None:
        self.labels[progress_label(record.status, record.outcome)] += 1
        self.activated += record.activation is not None
        self.hazards.update({name for name, _ in record.hazards})
        self.silent += bool(record.hazards) and reaction_time(record.hazards, record.alerts) is None


class WatchedRun:
    """The records of one run so far. The caller ensures that only one thread polls."""

    def __init__(self, folder: RunFolder) -> None:
        self._folder = folder
        self._tail = LineTail(folder.path, RECORDS_FOLDER)
        self._planned = PlannedExperiments(folder.path)
        self._sentences = ExperimentSentences.of_run(folder.head)
        self._columns = result_columns_of(folder)
        self._counts = _RunCounts(hazards=Counter(dict.fromkeys(folder.head.hazards, 0)))
        self._finished_ids: set[str] = set()
        self._harness_error_ids: set[str] = set()
        self._worst: list[FinishedExperiment] = []
        self._rows: list[ResultRow] = []
        self._version = next(_version_numbers)

    def poll(self) -> None:
        """Read what workers appended since the last call, or a part of it."""
        new_experiments = []
        for line in self._tail.read_new_lines(_MOST_BYTES_AT_ONCE):
            try:
                record = record_from_json(parse_json(line))
                experiment = self._planned[record.experiment_id]
            except (
                MutatorError,
                LookupError,
                TypeError,
                ValueError,
            ):  # a head, or nothing that a worker wrote
                continue
            if self._count_if_new(record) and self._can_be_listed(record):
                new_experiments.append(self._finished(experiment, record))
        if new_experiments:
            self._keep_worst(new_experiments)

    def listed_experiment(self, name: str) -> FinishedExperiment | None:
        """Return one of the listed experiments."""
        return next((finished for finished in self._worst if finished.experiment.id == name), None)

    def as_json(self, seen_version: int) -> dict[str, Any]:
        """Return counts and rows, without the rows that the page has."""
        counts, head = self._counts, self._folder.head
        return {
            "version": self._version,
            "planned": self._folder.planned_experiment_count,
            "done": len(self._finished_ids),
            "harness_errors": len(self._harness_error_ids),
            "activated": counts.activated,
            "hazards": [
                {"name": hazard, "about": self._hazard_meaning(hazard), "count": counts.hazards[hazard]}
                for hazard in head.hazards
            ],
            "silent": counts.silent if head.alerts else None,
            "outcomes": {label: number for label in _labels_in_order() if (number := counts.labels[label])},
            "behind": self._tail.has_more,
            "rows": None if seen_version == self._version else list(map(self._row_as_json, self._rows)),
        }

    def _hazard_meaning(self, hazard: str) -> str:
        return next((facts.about for facts in self._folder.head.about_hazards if facts.name == hazard), "")

    def _count_if_new(self, record: Record) -> bool:
        """Count a record; return whether it is a new result. A harness error is retried."""
        if record.experiment_id in self._finished_ids:
            return False
        if record.status is Status.HARNESS_ERROR:
            self._harness_error_ids.add(record.experiment_id)
            return False
        self._harness_error_ids.discard(record.experiment_id)
        self._finished_ids.add(record.experiment_id)
        self._counts.add(record)
        return True

    def _can_be_listed(self, record: Record) -> bool:
        """Whether a record can be among the worst: once hazards fill the list, nothing else can."""
        return record.outcome is Outcome.HAZARD or not (
            len(self._worst) == MOST_ROWS and self._worst[-1].record.outcome is Outcome.HAZARD
        )

    def _finished(self, experiment: Experiment, record: Record) -> FinishedExperiment:
        return FinishedExperiment(experiment, record, self._folder.severity_scale)

    def _keep_worst(self, new_experiments: Iterable[FinishedExperiment]) -> None:
        """Keep the worst results. One that falls out cannot come back: later ones only push it down."""
        candidates, head = [*self._worst, *new_experiments], self._folder.head
        frame = frame_of_finished(self._columns, candidates, head.hazards, head.families)
        order = worst_first_ranks(frame).argsort()[:MOST_ROWS].tolist()
        self._worst = [candidates[row] for row in order]
        faults = {finished.experiment.fault.id: finished.experiment.fault for finished in self._worst}
        self._rows = rows_of(frame.iloc[order], faults, self._sentences)
        self._version = next(_version_numbers)

    def _row_as_json(self, row: ResultRow) -> dict[str, Any]:
        scale = self._folder.severity_scale
        return {
            "id": row.experiment_id,
            "ending": row.ending,
            "severity": scale.labels.get(row.severity, "") if scale else "",
            "hazards": [name for name, _ in row.hazards],
            "fault": row.fault,
            "scenario": row.scenario_label,
            "trigger": row.trigger,
            "sentence": row.sentence,
        }


def _labels_in_order() -> list[str]:
    return [*(outcome.value for outcome in Outcome), *(s.value for s in Status if s is not Status.OK)]


class WatchedRuns:
    """The runs that pages watch at the moment, the last few of them."""

    def __init__(self) -> None:
        self._runs: dict[tuple[Path, int], WatchedRun] = {}
        self._lock = threading.Lock()

    def poll(self, folder: RunFolder, seen_version: int) -> dict[str, Any]:
        """Return counts and rows of a run up to now; NotServed if it has just been deleted."""
        with self._lock:
            watched = self._watched(folder)
            watched.poll()
            return watched.as_json(seen_version)

    def listed_experiment(self, folder: RunFolder, name: str) -> FinishedExperiment | None:
        """Return one of the worst experiments of a run so far; None if it is not among them."""
        with self._lock:
            watched = self._watched(folder)
            watched.poll()
            return watched.listed_experiment(name)

    def _watched(self, folder: RunFolder) -> WatchedRun:
        # a new run can have the name of a deleted one
        try:
            key = folder.path, (folder.path / "run.json").stat().st_ino
        except OSError:
            raise NotServed(
                f"the run '{folder.path.name}' was deleted",
                expected="one of the served runs",
                remedy="see the first page",
            ) from None
        watched = self._runs.pop(key, None) or WatchedRun(folder)
        self._runs[key] = watched
        for old in list(self._runs)[:-_MOST_WATCHED_RUNS]:
            del self._runs[old]
        return watched


def state_as_json(run_state: RunState) -> dict[str, Any]:
    """Return what happens to a run, for the page that watches it."""
    progress = run_state.progress
    return {
        "state": run_state.state,
        "stage": progress.stage if progress else None,
        "stage_done": progress.done if progress else 0,
        "stage_total": progress.total if progress else 0,
        "detail": progress.detail if progress else "",
        "rate": describe_rate(progress) if progress else "",
        "rest": describe_duration(progress.remaining_s) if progress and progress.remaining_s else "",
        "problem": run_state.problem,
    }
