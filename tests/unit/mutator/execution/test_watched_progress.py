"""What a session leaves for those who watch its run folder."""

from pathlib import Path

import pytest

from mutator.execution.watched_progress import writing_progress
from mutator.store.run_progress import Progress
from mutator.store.session_progress import read_session_progress

CHECKS = Progress(stage="checks", done=1, total=7)


def test_progress_is_written_while_the_session_works_and_removed_afterwards(tmp_path: Path) -> None:
    """Whoever started the session is told the same."""
    notices: list[Progress] = []
    with writing_progress(tmp_path, notices.append) as watched:
        started = read_session_progress(tmp_path)
        assert started and (started.progress, started.problem) == (Progress(stage="plan"), "")
        watched.notify(CHECKS)
        stored = read_session_progress(tmp_path)
        assert stored and (stored.progress, stored.problem) == (CHECKS, "")
    assert notices == [CHECKS]
    assert read_session_progress(tmp_path) is None


@pytest.mark.parametrize(
    ("progress", "error", "problem"),
    [
        (CHECKS, ValueError("no space left"), "no space left"),
        (CHECKS, ValueError(), "ValueError"),
        (Progress(stage="plan"), ValueError("no such campaign"), None),
        (CHECKS, KeyboardInterrupt(), None),
    ],
)
def test_only_a_failure_during_the_work_leaves_its_cause(
    tmp_path: Path, progress: Progress, error: BaseException, problem: str | None
) -> None:
    """A refused session has changed nothing, and an interruption is no failure."""
    with pytest.raises(type(error)), writing_progress(tmp_path, None) as watched:
        watched.notify(progress)
        raise error
    stored = read_session_progress(tmp_path)
    assert (stored and stored.problem) == problem


def test_a_problem_of_the_session_is_left_too(tmp_path: Path) -> None:
    with writing_progress(tmp_path, None) as watched:
        watched.notify(CHECKS)
        watched.problem = "a worker died"
    stored = read_session_progress(tmp_path)
    assert stored and (stored.progress, stored.problem) == (CHECKS, "a worker died")
