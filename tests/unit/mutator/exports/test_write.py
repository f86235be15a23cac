"""Exports in a format of another package."""

import json
from collections.abc import Callable
from pathlib import Path

import mutator
from mutator.workspace import Workspace


def test_a_format_of_another_package_is_written(
    tmp_path: Path,
    door_examples: Path,
    copy_toycar: Callable[[Path], Workspace],
    write_run: Callable[..., Path],
) -> None:
    run = mutator.load_run(write_run(copy_toycar(tmp_path), tmp_path / "run", lambda e: {}))
    written = run.export("counts")
    assert written == run.path / "exports" / "counts.json"
    assert sum(json.loads(written.read_text()).values()) == len(run.folder.records())
    run.delete()  # what another package exports is no stranger in the folder
