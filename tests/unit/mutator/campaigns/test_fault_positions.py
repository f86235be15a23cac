"""Where faults are in the files of the user."""

from collections.abc import Callable
from pathlib import Path

import pytest

from mutator.campaigns.fault_positions import FaultPositions, path_in_repository
from mutator.errors import MutatorError
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace


def test_a_path_is_relative_to_the_repository_that_contains_the_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without a repository, it is relative to the current folder, and elsewhere absolute. A work tree has a
    file `.git`."""
    file = tmp_path / "work" / "car" / "pilot.py"
    file.parent.mkdir(parents=True)
    assert path_in_repository(file) == file.as_posix()
    monkeypatch.chdir(tmp_path / "work" / "car")
    assert path_in_repository(file) == "pilot.py"
    (tmp_path / "work" / ".git").write_text("gitdir: elsewhere\n")
    assert path_in_repository(file) == "car/pilot.py"


def test_a_fault_is_at_the_statement_of_its_spec(
    toycar: Workspace, tmp_path: Path, write_run: Callable[..., Path]
) -> None:
    folder = RunFolder.open(write_run(toycar, tmp_path / "run"))
    (tmp_path / ".git").mkdir()
    positions = FaultPositions.of_run(folder, toycar)
    lane = toycar.faults("sensor/lane", seed=7)[0]
    [position] = positions.of_fault(lane)
    assert position.path.endswith("tree/toycar/sensing.py")
    line = (tmp_path / position.path).read_text().splitlines()[position.first_line - 1]
    assert line.strip().startswith("offset = ")
    assert position.last_line == position.first_line


def test_the_source_of_another_version_has_no_positions(
    toycar: Workspace, tmp_path: Path, write_run: Callable[..., Path]
) -> None:
    folder = RunFolder.open(write_run(toycar, tmp_path / "run"))
    (toycar.library.parent / "tree" / "toycar" / "driver.py").write_text("x = 1\n")
    with pytest.raises(MutatorError, match="has changed since this run was planned"):
        FaultPositions.of_run(folder, toycar)
