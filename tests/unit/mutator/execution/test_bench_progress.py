"""How far an open bench is."""

from collections import Counter

from mutator.execution.bench_progress import BenchProgress
from mutator.execution.records_without_outcome import record_without_outcome
from mutator.model import Record, Status
from mutator.store.run_progress import Progress


def record(name: str, status: Status) -> Record:
    return record_without_outcome(name, status, "")


def test_the_progress_is_that_of_all_planned_experiments() -> None:
    """A repeated experiment counts once, with its last status; without work, the bench waits."""
    notices: list[Progress] = []
    progress = BenchProgress(notices.append)
    progress.note_stored([record("a", Status.CRASHED), record("b", Status.HARNESS_ERROR)])
    progress.note_planned(3)
    progress.note_record(record("b", Status.TIMEOUT))
    assert [(notice.done, notice.total, notice.detail) for notice in notices] == [(2, 3, "")]
    progress.note_record(record("c", Status.TIMEOUT))
    last = notices[-1]
    assert (last.stage, last.done, last.detail) == ("experiments", 3, "waits for the next batch")
    assert last.outcomes == Counter(crashed=1, timeout=2)


def test_runs_of_the_proof_are_counted_apart() -> None:
    """They change no outcome of an experiment."""
    notices: list[Progress] = []
    progress = BenchProgress(notices.append)
    progress.note_stored([record("a", Status.CRASHED)])
    progress.note_planned(1)
    progress.note_proof(1)
    progress.note_record(record("a", Status.TIMEOUT))
    progress.note_proof_ended()
    assert [(notice.stage, notice.total) for notice in notices] == [
        ("experiments", 1),
        ("proof", 1),
        ("experiments", 1),
    ]
    assert notices[-1].outcomes == Counter(crashed=1)
