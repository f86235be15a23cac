"""Invalid arguments of the Python API."""

from collections.abc import Callable
from math import nan
from pathlib import Path
from typing import Any

import pytest

import mutator
from mutator.errors import MutatorError
from mutator.workspace import Workspace

CHOICES: Any = mutator.Choices


def drive(workspace: Workspace, **given: Any) -> mutator.Trial:
    return mutator.try_fault("sensor/lane", "A", workspace=workspace, **given)


@pytest.mark.parametrize(
    ("call", "argument"),
    [
        (lambda w, out: CHOICES(limit="3"), "limit"),
        (lambda w, out: CHOICES(limit=0), "limit"),
        (lambda w, out: CHOICES(seed="x"), "seed"),
        (lambda w, out: CHOICES(seed=True), "seed"),
        (lambda w, out: CHOICES(shard=(5, 2)), "shard"),
        (lambda w, out: CHOICES(shard="5/2"), "shard"),
        (lambda w, out: CHOICES(only=3), "only"),
        (lambda w, out: mutator.plan("toy", choices={"limit": 3}, workspace=w), "choices"),
        (lambda w, out: mutator.run("toy", out, choices={"limit": 3}, workspace=w), "choices"),
        (lambda w, out: mutator.run("toy", out, workers=-1, workspace=w), "workers"),
        (lambda w, out: mutator.run("toy", out, engine="steam", workspace=w), "engine"),
        (lambda w, out: mutator.merge_runs([], out), "shards"),
        (lambda w, out: mutator.merge_runs("runs/q", out), "shards"),
        (lambda w, out: w.faults(seed="x"), "seed"),
        (lambda w, out: mutator.build_mutant("sensor/lane", nan, workspace=w), "trigger"),
        (lambda w, out: mutator.build_mutant("sensor/lane", -3, workspace=w), "trigger"),
        (lambda w, out: mutator.build_mutant("sensor/lane", True, workspace=w), "trigger"),
        (lambda w, out: mutator.build_mutant("sensor/lane", "no such", workspace=w), "trigger"),
        (lambda w, out: mutator.build_mutant("sensor/distance", value="40", workspace=w), "value"),
        (lambda w, out: mutator.build_mutant("sensor/distance", value=nan, workspace=w), "value"),
        (lambda w, out: mutator.build_mutant("sensor/distance", seed="x", workspace=w), "seed"),
        (lambda w, out: drive(w, armed_after_s=nan), "armed_after_s"),
        (lambda w, out: drive(w, armed_after_s=-1), "armed_after_s"),
    ],
)  # fmt: skip
def test_the_error_for_a_wrong_argument_uses_its_python_name(
    toycar: Workspace, tmp_path: Path, call: Callable[[Any, Path], Any], argument: str
) -> None:
    out = tmp_path / "out"
    with pytest.raises(MutatorError) as caught:
        call(toycar, out)
    assert caught.value.argument == argument
    assert str(caught.value).startswith(f"{argument}: ")
    assert "--" not in str(caught.value)
    assert not (out / "results.csv").exists()


def test_a_run_is_opened_with_load_run() -> None:
    """`Run` takes no path: the error says at once what does."""
    unsuitable: Any = mutator.Run
    with pytest.raises(MutatorError, match=r"mutator\.load_run\(path\)"):
        unsuitable("/path")


def test_an_experiment_id_must_be_text(toycar: Workspace, tmp_path: Path) -> None:
    mutator.plan("toy", tmp_path / "p", workspace=toycar)
    wrong: Any = 3
    with pytest.raises(MutatorError, match=r"^id: 3; expected the id of an experiment"):
        mutator.load_run(tmp_path / "p").experiment(wrong)
