"""The speed of a stage and its remaining time."""

import pytest

from mutator.store import run_progress
from mutator.store.run_progress import StagePace


def test_earlier_steps_do_not_count_towards_a_stages_rate(monkeypatch: pytest.MonkeyPatch) -> None:
    now = 100.0
    monkeypatch.setattr(run_progress.time, "monotonic", lambda: now)
    pace = StagePace("proof", 23, finished_before=3)
    assert (pace.progress_at(3).per_s, pace.progress_at(3).remaining_s) == (None, None)
    now = 108.0
    told = pace.progress_at(7, detail="S1")
    assert (told.stage, told.done, told.total, told.detail) == ("proof", 7, 23, "S1")
    assert (told.per_s, told.remaining_s) == (0.5, 32.0)
