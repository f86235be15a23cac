"""Exports in a format of another package."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest

import mutator
from mutator.errors import MutatorError
from mutator.exports import find_export
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


def test_a_file_that_clean_would_not_know_is_refused(tmp_path: Path, install: Callable[[Path], None]) -> None:
    source = "from mutator.exports import Export\nE = Export(about='', file='mine.csv', write=bytes)"
    (tmp_path / "odd_export.py").write_text(source)
    text = '[project]\nname = "odd"\nversion = "1"\n[project.entry-points."mutator.exports"]\n'
    (tmp_path / "pyproject.toml").write_text(f'{text}odd = "odd_export:E"\n')
    install(tmp_path)
    with pytest.raises(MutatorError, match=r"writes the file 'mine\.csv'; expected the name 'odd'"):
        find_export("odd")
