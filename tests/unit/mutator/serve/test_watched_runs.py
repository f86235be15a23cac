"""A run is watched while it grows."""

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from mutator._common.folder_locks import lock_run_folder
from mutator.errors import NotServed
from mutator.model import Outcome, Status
from mutator.results import table_building
from mutator.results.table_reader import Results
from mutator.results.worst_first_ranking import worst_first_ranks
from mutator.serve import watched_runs
from mutator.serve.run_states import count_records, state_of_run
from mutator.serve.watched_runs import WatchedRun, WatchedRuns
from mutator.store import file_digests
from mutator.store.checksummed_lines import LineWriter
from mutator.store.records import RECORDS_SCHEMA
from mutator.store.run_folder import RunFolder
from mutator.store.run_progress import Progress
from mutator.store.session_progress import write_session_progress
from mutator.workspace import Workspace

HAZARD = {"outcome": Outcome.HAZARD, "hazards": (("H3", 4.0),)}


@pytest.fixture
def planned(toycar: Workspace, write_run: Callable[..., Path], tmp_path: Path) -> RunFolder:
    """A run without a record."""
    return RunFolder.open(write_run(toycar, tmp_path / "run", lambda experiment: None))


@pytest.fixture
def append(planned: RunFolder, record: Callable[..., Any]) -> Callable[..., None]:
    """Append the record of the n-th experiment, as a worker does."""
    writer = LineWriter(
        planned.path / "records" / "0002-b.jsonl", {"schema": RECORDS_SCHEMA, "plan": planned.head.plan}
    )
    ids = list(planned.experiment_ids())
    unchanged = {"max_dev": tuple((name, 0.0) for name in planned.head.compared)}

    def appended(number: int, **fields: Any) -> None:
        writer.append(dataclasses.asdict(record(ids[number], **unchanged | fields)))
        writer.sync()

    return appended


def test_counts_follow_the_records(planned: RunFolder, append: Callable[..., None]) -> None:
    watched = WatchedRun(planned)
    watched.poll()
    start = watched.as_json(0)
    assert (start["done"], start["planned"], start["rows"]) == (0, planned.planned_experiment_count, [])
    append(0, **HAZARD)
    append(1, **HAZARD, alerts=(("brake_hard", 3.0),))
    append(2, outcome=Outcome.NOT_ACTIVATED, activation=None)
    append(3, status=Status.HARNESS_ERROR, outcome=None, activation=None)
    watched.poll()
    data = watched.as_json(start["version"])
    assert (data["done"], data["activated"], data["silent"], data["harness_errors"]) == (3, 2, 1, 1)
    assert {hazard["name"]: hazard["count"] for hazard in data["hazards"]}["H3"] == 2
    assert data["outcomes"] == {"hazard": 2, "not_activated": 1}
    assert [row["ending"] for row in data["rows"]] == ["hazard", "hazard", "not_activated"]
    assert "No alert." in data["rows"][0]["sentence"]
    append(3)
    watched.poll()
    retried = watched.as_json(data["version"])
    assert (retried["done"], retried["harness_errors"]) == (4, 0)


def test_rows_are_sent_again_only_when_they_have_changed(
    planned: RunFolder, append: Callable[..., None]
) -> None:
    runs = WatchedRuns()
    append(0, **HAZARD)
    first = runs.poll(planned, 0)
    assert len(first["rows"]) == 1
    assert runs.poll(planned, first["version"])["rows"] is None
    append(1)
    assert len(runs.poll(planned, first["version"])["rows"]) == 2


def test_the_list_is_ranked_as_the_table_whatever_the_order_of_arrival(
    planned: RunFolder, append: Callable[..., None], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Only some rows are in memory, however long the run is."""
    monkeypatch.setattr(watched_runs, "MOST_ROWS", 4)
    watched = WatchedRun(planned)
    for number in range(12):
        fields = HAZARD | {"hazards": (("H3", 9.0 - number % 7),)} if number % 3 else {}
        append(number, **fields)
        watched.poll()
    table_building.build_tables(planned.path)
    frame = Results(planned.path).frame()
    order = worst_first_ranks(frame).argsort()[:4]
    assert [row["id"] for row in watched.as_json(0)["rows"]] == frame["experiment_id"].iloc[order].tolist()
    assert watched.as_json(0)["done"] == 12


def test_a_line_that_no_worker_wrote_is_not_counted(planned: RunFolder, append: Callable[..., None]) -> None:
    append(0, **HAZARD)
    path = planned.path / "records" / "0002-b.jsonl"
    with path.open("ab") as file:
        file.write(b'{"sum":"0123456789abcdef","experiment_id":"x"}\n{"half')
    watched = WatchedRun(planned)
    watched.poll()
    assert watched.as_json(0)["done"] == 1


def test_a_run_that_is_deleted_while_somebody_asks_is_not_served(planned: RunFolder) -> None:
    """Its folder can go between two reads."""
    (planned.path / "run.json").unlink()
    with pytest.raises(NotServed, match="was deleted"):
        WatchedRuns().poll(planned, 0)


def test_no_file_stays_open_and_old_runs_are_forgotten(
    planned: RunFolder, append: Callable[..., None], tmp_path: Path
) -> None:
    """A page can stay open for days."""
    runs = WatchedRuns()
    append(0)
    runs.poll(planned, 0)
    before = len(list(Path("/proc/self/fd").iterdir()))
    for _ in range(20):
        runs.poll(planned, 0)
    assert len(list(Path("/proc/self/fd").iterdir())) == before
    assert len(runs._runs) == 1


def test_the_state_of_a_run_is_that_of_its_session(planned: RunFolder) -> None:
    progress = Progress(stage="golden", done=1, total=2)
    assert state_of_run(planned).state == "unfinished"
    with lock_run_folder(planned.path):
        write_session_progress(planned.path, progress)
        running = state_of_run(planned)
        assert (running.state, running.progress) == ("running", progress)
    assert state_of_run(planned).state == "unfinished"  # killed: nobody holds the lock
    write_session_progress(planned.path, progress, f"{planned.path}/x: no space left")
    failed = state_of_run(planned)
    assert (failed.state, failed.problem) == ("failed", "x: no space left")
    file_digests.add_segments_to_ledger(planned.path, finished=True)
    assert state_of_run(planned).state == "finished"


def test_an_unfinished_run_is_counted_from_its_records(
    planned: RunFolder, append: Callable[..., None]
) -> None:
    """It has no tables, or older ones."""
    assert count_records(planned.path) == {}
    append(0, **HAZARD)
    append(1, status=Status.HARNESS_ERROR, outcome=None)
    append(1)
    assert count_records(planned.path) == {"hazard": 1, "masked": 1}
