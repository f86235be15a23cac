"""Experiments of the toy car are shrunk: what is smallest, what a kill changes, what is refused and saved."""

import os
import signal
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

import mutator
from mutator import CheckFailed, MutatorError, Run, RunExperiment, SmallestForm, Workspace
from mutator.api import shrinks
from mutator.campaigns.regression_files import load_regressions
from mutator.execution.bench import Bench
from mutator.store.run_folder import RunFolder

_SPEC = """\
schema: fault_spec/1
module: sensor
fault_type: pair
about: The measured distance and the measured offset are wrong.
variants:
  both:
    aim: H3
    about: Only the offset matters for the lane.
    draw:
      offset_m: {values: [0.5, 1.6, 2.2, 2.4]}
    as_described:
      injections:
        - at: {file: toycar/sensing.py, function: Sensor.sense, after_assign: gap}
          model: offset
          unit: m
          params: {by_m: offset}
        - at: {file: toycar/sensing.py, function: Sensor.sense, after_assign: offset}
          model: offset
          unit: m
          params: {by_m: offset}
  latched:
    aim: H3
    about: The offset stays wrong.
    hold: to_end
    draw:
      offset_m: {values: [3.0]}
    as_described:
      injections:
        - at: {file: toycar/sensing.py, function: Sensor.sense, after_assign: offset}
          model: offset
          unit: m
          params: {by_m: offset}
"""
_CAMPAIGN = """\
schema: campaign/1
name: pair
about: A fault with two injections, and one that latches.
target: toycar
scenarios: [A, B]
faults: [{spec: sensor/pair/*}]
triggers: {list: [{at_s: 1.2}], armed_after_s: 1.0}
seed: 3
canary: {spec: sensor/lane/shifted, scenario: A, hazard: H3, at_s: 1.0}
limits: {cpu_s: 20, wall_s: 60, memory_mb: 1024, steps: 200}
"""


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory, copy_toycar: Callable[[Path], Workspace]) -> Run:
    folder = tmp_path_factory.mktemp("shrink")
    toycar = copy_toycar(folder)
    (toycar.library / "faults/sensor/pair.yaml").write_text(_SPEC)
    (toycar.library / "campaigns/pair.yaml").write_text(_CAMPAIGN)
    return mutator.run("pair", folder / "runs/pair", workers=1, workspace=toycar)


def experiment(run: Run, value: float | None, scenario: str) -> RunExperiment:
    chosen = (e for e in run.experiments.values() if (e.fault.value, e.scenario) == (value, scenario))
    return run.experiment(next(chosen).id)


@pytest.fixture(scope="module")
def smallest(run: Run) -> SmallestForm:
    return experiment(run, 2.4, "B").shrink()


def test_the_smallest_form_has_the_hazard_and_its_neighbours_have_not(
    run: Run, smallest: SmallestForm
) -> None:
    """A short fault with one injection in the simpler scenario; the records of the run folder say so."""
    assert (smallest.hazard, smallest.experiment.scenario, smallest.start_s) == ("H3", "A", 1.2)
    [injection] = smallest.experiment.fault.injections
    assert injection.location.anchor.name == "offset"
    assert smallest.experiment.fault.value in (1.6, 2.2)
    assert smallest.duration_s and smallest.duration_s < 2.0
    records = mutator.load_run(smallest.run).records
    assert "H3" in dict(records[smallest.experiment.id].hazards)
    assert set(smallest.neighbours) == {"duration", "size"}
    assert all("H3" not in dict(records[e.id].hazards) for e in smallest.neighbours.values())
    assert smallest.runs == len(records) <= 35
    assert smallest.run == run.path.parent / "shrunk" / f"pair-{smallest.original.id}"
    assert mutator.verify(smallest.run, workspace=run.workspace).passed


@pytest.mark.slow
def test_a_killed_search_goes_on_where_it_was(run: Run, smallest: SmallestForm, tmp_path: Path) -> None:
    """The same result and seal as without the kill, and nothing that had finished runs again."""
    out = tmp_path / "killed"
    if not (child := os.fork()):
        whole, batches = Bench.run, iter(range(3))

        def run_three(bench, experiments, reason=""):  # type: ignore[no-untyped-def]
            if next(batches, None) is None:
                os.kill(os.getpid(), signal.SIGKILL)
            return whole(bench, experiments, reason)

        Bench.run = run_three  # type: ignore[method-assign]
        experiment(run, 2.4, "B").shrink(out)
        os._exit(0)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == -signal.SIGKILL
    before = mutator.load_run(out).records
    again = experiment(run, 2.4, "B").shrink(out)
    assert before
    assert replace(again, run=smallest.run) == smallest
    assert mutator.load_run(out).seal == mutator.load_run(smallest.run).seal


def test_a_saved_form_is_a_campaign_and_a_regression(
    run: Run, smallest: SmallestForm, tmp_path: Path
) -> None:
    """Both have the fault that was shrunk; the name cannot be used twice, nor lead out of the library."""
    paths, reason = smallest.save("short_pair")
    assert reason == ""
    root = run.workspace.library.parent
    assert paths == [
        root / "regressions/short_pair.yaml",
        run.workspace.library / "campaigns/short_pair.yaml",
    ]
    [saved] = load_regressions(paths[0]).experiments
    assert saved.experiment == smallest.experiment
    assert saved.expectation.hazards == [name for name, _ in smallest.record.hazards]
    [planned] = mutator.plan("short_pair", workspace=run.workspace).experiments
    assert planned.fault.injections == smallest.experiment.fault.injections
    assert planned.trigger.hold_s == smallest.duration_s
    again = mutator.run("short_pair", tmp_path / "short", workers=1, workspace=run.workspace)
    assert again.records[planned.id].hazards == smallest.record.hazards
    with pytest.raises(MutatorError, match="there is such a file"):
        smallest.save("short_pair")
    with pytest.raises(MutatorError, match="a name of lowercase letters"):
        smallest.save("../outside")


def test_a_fault_that_latches_is_not_shortened(run: Run, tmp_path: Path) -> None:
    """A spec with `hold: to_end` keeps it."""
    form = experiment(run, 3.0, "B").shrink(tmp_path / "latched")
    assert (form.experiment.scenario, form.duration_s, form.start_s) == ("A", None, 1.2)
    assert form.experiment.trigger.hold_s is None
    assert "declares the hold `to_end`" in form.notes[0]
    assert form.minimal == "nothing smaller can be tried"


def test_a_result_that_the_reference_engine_contradicts_is_refused(
    run: Run, smallest: SmallestForm, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The smallest form is driven again there, unless it is in the proved sample."""
    monkeypatch.setattr(shrinks, "rerun_experiment", lambda *arguments, **options: (None, False))
    monkeypatch.setattr(shrinks, "PROOF_FOLDER", "nothing")
    with pytest.raises(CheckFailed, match="differs on the reference engine"):
        experiment(run, 2.4, "B").shrink()


def test_an_unfinished_run_is_refused(run: Run, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Its results are not proved."""
    hazardous = experiment(run, 2.4, "B")
    monkeypatch.setattr(RunFolder, "is_finished", False)
    with pytest.raises(MutatorError, match="this run is not finished"):
        hazardous.shrink(tmp_path / "out")


def test_what_cannot_be_shrunk_is_refused(run: Run, tmp_path: Path) -> None:
    """An experiment without a hazard, and edited sources: each in one sentence, and no folder is left."""
    with pytest.raises(MutatorError, match="reached no hazard"):
        experiment(run, 0.5, "A").shrink(tmp_path / "out")
    hazardous = experiment(run, 2.4, "B")
    for name, old, new in (
        ("faults/sensor/pair.yaml", "{by_m: offset}", "{by_m: -offset}"),
        ("scenarios/A.yaml", "gap: 40", "gap: 41"),
    ):
        file = run.workspace.library / name
        text = file.read_text()
        file.write_text(text.replace(old, new))
        try:
            with pytest.raises(MutatorError, match="changed since"):
                mutator.load_run(run.path, workspace=run.workspace).experiment(hazardous.id).shrink(
                    tmp_path / "out"
                )
        finally:
            file.write_text(text)
    assert not (tmp_path / "out").exists()
