"""The key of a finished run contains all that decides its record, and nothing else."""

import dataclasses
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

import mutator
from mutator.campaigns import run_environment
from mutator.execution import finished_run_keys
from mutator.execution.finished_run_keys import harness_digest, surroundings_digest
from mutator.model import Experiment
from mutator.workspace import Workspace


@pytest.mark.parametrize(
    ("name", "is_other"),
    [
        ("outcomes/verdict_rules.py", True),
        ("model.py", True),
        ("engines/in_target/run_once.py", True),
        ("report/panel.py", False),
        ("cli/app.py", False),
    ],
)
def test_the_harness_is_part_of_the_key_but_for_what_shows_results(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, is_other: bool
) -> None:
    before = harness_digest()
    copy = tmp_path / "mutator"
    shutil.copytree(Path(mutator.__file__).parent, copy, ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.setattr(finished_run_keys, "_HARNESS_FOLDER", copy)
    harness_digest.cache_clear()
    assert harness_digest() == before
    (copy / name).write_text((copy / name).read_text() + "\n")
    harness_digest.cache_clear()
    assert (harness_digest() != before) == is_other
    harness_digest.cache_clear()


def test_an_unrelated_package_changes_no_key(toycar: Workspace, monkeypatch: pytest.MonkeyPatch) -> None:
    """But another version of one that the harness requires does."""
    manifest, installed = toycar.manifest("toycar"), run_environment._installed_packages()
    before = surroundings_digest(toycar, manifest)
    with_other = {**installed, "unrelated": ("1.0", [])}
    monkeypatch.setattr(run_environment, "_installed_packages", lambda: with_other)
    assert surroundings_digest(toycar, manifest) == before
    with_new_numpy = {**installed, "numpy": ("99.0", installed["numpy"][1])}
    monkeypatch.setattr(run_environment, "_installed_packages", lambda: with_new_numpy)
    assert surroundings_digest(toycar, manifest) != before


def test_the_name_of_a_scenario_is_part_of_the_key(experiment: Callable[..., Experiment]) -> None:
    """An error of the target can contain it, and then stands in the record."""
    asked = experiment()
    renamed = dataclasses.replace(asked, scenario=f"{asked.scenario}_again")
    keys = {finished_run_keys.run_key("", each, "", "") for each in (asked, asked, renamed)}
    assert len(keys) == 2
