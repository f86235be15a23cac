"""The keys of served runs."""

import shutil
from pathlib import Path

import pytest

from mutator._common.folder_locks import lock_run_folder
from mutator.serve.served_runs import ServedRuns

from ..report.made_run import make_run


@pytest.fixture
def runs(tmp_path: Path) -> ServedRuns:
    """Two served folders, of which the second has a run."""
    roots = (tmp_path / "a", tmp_path / "b")
    for root in roots:
        root.mkdir()
    add_run(roots[1])
    return ServedRuns(roots)


def add_run(root: Path, name: str = "night") -> Path:
    (root / name).mkdir()
    return make_run(root / name)


def test_a_new_run_of_the_same_name_does_not_take_the_key(runs: ServedRuns) -> None:
    """An open page would read the new run, which is found first."""
    first, second = runs.roots
    assert runs.folders_by_key() == {"night": second / "night"}
    new = add_run(first)
    assert runs.folders_by_key() == {"night-2": new, "night": second / "night"}
    assert runs.key_of(new) == "night-2"


def test_a_run_keeps_its_key_after_another_one_is_deleted(runs: ServedRuns) -> None:
    first, second = runs.roots
    new = add_run(first)
    assert runs.folders_by_key() == {"night": new, "night-2": second / "night"}
    shutil.rmtree(new)
    assert runs.folders_by_key() == {"night-2": second / "night"}


def test_a_folder_of_the_same_name_is_not_the_run_that_is_planned(runs: ServedRuns) -> None:
    """A page that waits for a plan must not change to another run."""
    first, second = runs.roots
    assert runs.folder("night") == second / "night"
    (first / "night").mkdir()
    with lock_run_folder(first / "night"):
        assert runs.unplanned_folder("night") is None
        assert runs.unplanned_folder("night-2") == first / "night"


def test_a_planned_run_keeps_its_key_when_it_has_a_plan(runs: ServedRuns) -> None:
    first, second = runs.roots
    (second / "new").mkdir()
    with lock_run_folder(second / "new"):
        assert runs.unplanned_folder("new") == second / "new"
    make_run(second / "new")
    add_run(first, "new")
    assert runs.folder("new") == second / "new"
