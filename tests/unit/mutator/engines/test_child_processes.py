"""Targets with child processes: engines agree, and no two runs share a process."""

from dataclasses import replace
from pathlib import Path

import pytest

import mutator
from mutator.engines.engine_choice import make_engine
from mutator.engines.engine_jobs import EngineArguments, RunMode
from mutator.execution.experiment_runner import ExperimentRunner, RecordedExperiment
from mutator.execution.inactivity_check import InactivityCheck
from mutator.execution.loaded_goldens import LoadedGoldens
from mutator.limits import Limits
from mutator.model import Outcome
from mutator.workspace import Workspace
from tests.small_loop import small_loop
from tests.unit.mutator.execution.test_inactivity_check import AT_LAW, FORKING, LAW, REASONS, controller


def run_on(engine_name: str, workspace: Workspace, folder: Path) -> RecordedExperiment:
    """Run the fault c/f/one, active from 0.5 s, on an engine, and return the result with its record."""
    trial = mutator.try_fault("c/f/one", "s", "t>=0.5", workspace=workspace, out=folder / "try")
    manifest, models = workspace.manifest("t"), workspace.fault_models()
    (folder / "work").mkdir(exist_ok=True)
    arguments = EngineArguments(
        manifest=manifest, models=models, work_folder=folder / "work", limits=Limits()
    )
    goldens = LoadedGoldens(manifest, lambda experiment: trial.single.golden)
    engine = make_engine(engine_name, arguments)
    check = InactivityCheck(arguments)
    runner = ExperimentRunner(manifest, models, engine, goldens, workspace.scenario, inactivity_check=check)
    try:
        (finished,) = runner.run([trial.experiment])
    finally:
        runner.close()
    assert finished.record == trial.record, "the reference engine's record"
    return replace(finished, output_folder=None)


@pytest.mark.parametrize("kind", ["never called", "one early step", "traced in the constructor"])
def test_the_reason_is_the_same_from_a_fork(tmp_path: Path, kind: str) -> None:
    """A forked run that was never active gets the reference engine's reason."""
    finished = run_on("fork", small_loop(tmp_path, REASONS[kind][0], one=AT_LAW), tmp_path)
    assert (finished.mode, finished.record.outcome) == (RunMode.FORK, Outcome.NOT_ACTIVATED)


def test_activations_in_children_are_the_same_from_a_fork(tmp_path: Path) -> None:
    """A fork counts what its own children do, like the reference engine."""
    workspace = small_loop(tmp_path, {"law.py": controller(LAW + FORKING, call="ask(y, rate)")}, one=AT_LAW)
    finished = run_on("fork", workspace, tmp_path)
    assert finished.mode is RunMode.FORK
    assert finished.record.activation and finished.record.activation.count == 10


def test_a_run_with_a_living_child_is_not_forked(tmp_path: Path) -> None:
    """Forks would share the child and its pipes, so the reference engine runs the mutant."""
    workspace = small_loop(tmp_path, REASONS["a worker in the constructor"][0], one=AT_LAW)
    finished = run_on("fork", workspace, tmp_path)
    assert finished.mode is RunMode.REFERENCE
    assert "it has started 1 process, which forks would share" in finished.fallback_reason


def test_a_file_that_is_loaded_under_two_names_is_not_forked(tmp_path: Path) -> None:
    """A fork would change only one of the two modules; the reference engine changes the file."""
    text = "import os\nimport sys\nsys.path.insert(0, os.path.join(os.path.dirname(__file__), 'pkg'))\n"
    text += "import pkg.gains\nfrom gains import law\n\n\n"
    files = {"law.py": controller(text), "pkg/__init__.py": "", "pkg/gains.py": LAW}
    workspace = small_loop(tmp_path, files, one="{file: pkg/gains.py, function: law, after_assign: push}")
    finished = run_on("fork", workspace, tmp_path)
    assert finished.mode is RunMode.REFERENCE
    assert "the file of pkg.gains is also loaded as gains" in finished.fallback_reason
    assert finished.record.activation is not None
