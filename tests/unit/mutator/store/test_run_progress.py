"""The speed of a stage and its remaining time."""

from collections.abc import Callable

import pytest

from mutator.store import run_progress
from mutator.store.run_progress import Progress, StagePace

Advance = Callable[[float, int], Progress]  # time in s, finished steps


@pytest.fixture
def advance(monkeypatch: pytest.MonkeyPatch) -> Advance:
    """Move the clock of a stage with 23 steps, 3 of them from an earlier session."""
    monkeypatch.setattr(run_progress.time, "monotonic", lambda: 100.0)
    pace = StagePace("proof", 23, finished_before=3)

    def progress_at(now: float, finished: int) -> Progress:
        monkeypatch.setattr(run_progress.time, "monotonic", lambda: now)
        return pace.progress_at(finished, detail="S1")

    return progress_at


def test_the_start_of_workers_and_earlier_steps_do_not_count_towards_a_stages_rate(advance: Advance) -> None:
    """Workers take 10 s to start; then a step takes 2 s. The estimate comes with the second new step."""
    for now, finished in ((100.0, 3), (110.0, 4), (111.5, 4)):
        early = advance(now, finished)
        assert (early.per_s, early.remaining_s) == (None, None)
    second = advance(112.0, 5)
    assert (second.stage, second.done, second.total, second.detail) == ("proof", 5, 23, "S1")
    assert (second.per_s, second.remaining_s) == (0.5, 36.0)


def test_steps_of_workers_that_started_together_are_one_measurement(advance: Advance) -> None:
    """Eight workers finish their first steps within a second, and the next ones 10 s later: 0.8 steps a
    second, neither 8 nor 0.1.
    """
    assert advance(110.0, 6).per_s is None
    assert advance(110.9, 11).per_s is None
    assert advance(120.0, 12).per_s is None
    assert advance(120.9, 19).per_s == pytest.approx(0.734, abs=0.001)
