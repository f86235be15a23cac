"""`progress.json` says what a session does."""

import json
from collections import Counter
from pathlib import Path

import pytest

from mutator.store.run_progress import Progress
from mutator.store.session_progress import (
    PROGRESS_FILE,
    read_session_progress,
    remove_session_progress,
    write_session_progress,
)


def test_progress_is_read_as_it_was_written(tmp_path: Path) -> None:
    progress = Progress(
        stage="experiments",
        detail="2 workers",
        done=3,
        total=9,
        outcomes=Counter(sdc=3),
        per_s=0.5,
        remaining_s=12.0,
    )
    write_session_progress(tmp_path, progress, "no space left")
    stored = read_session_progress(tmp_path)
    assert stored is not None
    assert (stored.progress, stored.problem) == (progress, "no space left")
    remove_session_progress(tmp_path)
    remove_session_progress(tmp_path)
    assert read_session_progress(tmp_path) is None


@pytest.mark.parametrize(
    "text", ["", "[]", '{"schema": "progress/1"}', '{"schema": "progress/2"}', "{" * 5000]
)
def test_a_file_of_another_form_is_no_progress(tmp_path: Path, text: str) -> None:
    (tmp_path / PROGRESS_FILE).write_text(text)
    assert read_session_progress(tmp_path) is None


@pytest.mark.parametrize(
    ("name", "number"),
    [
        ("remaining_s", float("nan")),
        ("remaining_s", 1e308),
        ("per_s", float("inf")),
        ("per_s", -1.0),
        ("done", -1),
        ("total", 10**300),
        ("outcomes", {"sdc": -2}),
        ("outcomes", {"sdc": "2"}),
        ("problem", 3),
    ],
)
def test_numbers_that_no_session_has_are_no_progress(tmp_path: Path, name: str, number: object) -> None:
    """A page that shows them would fail, or be filled by one number."""
    write_session_progress(tmp_path, Progress(stage="checks"))
    stored = json.loads((tmp_path / PROGRESS_FILE).read_text())
    (tmp_path / PROGRESS_FILE).write_text(json.dumps(stored | {name: number}))
    assert read_session_progress(tmp_path) is None


def test_a_folder_that_cannot_be_written_stops_nobody(tmp_path: Path) -> None:
    """Progress is only for watching."""
    (tmp_path / PROGRESS_FILE).mkdir()
    write_session_progress(tmp_path, Progress(stage="checks"))
    assert read_session_progress(tmp_path) is None
