"""An exploration on a small target, through API and command line."""

import json
import os
import random
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from typer.testing import CliRunner

import mutator
from mutator.cli.app import app
from mutator.explore.cell_results import CellState
from mutator.explore.envelope_texts import describe_envelope
from mutator.store.records import load_records
from mutator.workspace import Workspace

SPEC = "sensor/lane/shifted"
_KILLS = 8
_EXPLORE = """
import sys
import mutator

workspace = mutator.Workspace.find(root=sys.argv[1])
mutator.envelope(
    "sensor/lane/shifted", ["A", "B"], 1, sys.argv[2], points=10, longest_s=3.0, observe_s=0.5, validation=20,
    campaign="small", workers=int(sys.argv[3]), workspace=workspace,
)
"""


def explore(workspace: Workspace, out: Path, points: int = 10, validation: int = 12) -> mutator.Envelopes:
    return mutator.envelope(
        SPEC,
        "A",
        1,
        out,
        points=points,
        longest_s=3.0,
        observe_s=0.5,
        validation=validation,
        campaign="small",
        workspace=workspace,
    )


@pytest.fixture(scope="module")
def finished_run(tmp_path_factory: pytest.TempPathFactory, copy_toycar: Callable[[Path], Workspace]) -> Path:
    """The run folder of a finished exploration in another copy of the toy car."""
    folder = tmp_path_factory.mktemp("explored")
    explore(copy_toycar(folder), folder / "run")
    return folder / "run"


@pytest.mark.usefixtures("kept_checks")
def test_an_envelope_is_an_ordinary_finished_run(
    toycar: Workspace, finished_run: Path, tmp_path: Path
) -> None:
    """The lane sensor may be 1 m wrong for any time, 2.5 m for a short one; the run folder is sealed, and the
    same call again runs nothing.
    """
    shutil.copytree(finished_run, tmp_path / "run")
    explored = explore(toycar, tmp_path / "run")
    [envelope] = explored
    assert envelope.survives(0.5, 3.0) and not envelope.survives(2.5, 3.0) and envelope.survives(2.5, 0.05)
    assert envelope.state_at(3.0, 1.0) is CellState.UNKNOWN  # larger than any that was asked for
    assert (envelope.largest_survived() or 0) >= 0.8
    pair = envelope.boundary_pair(len(envelope.magnitudes) - 1)
    assert pair and pair.hazardous.hazard == "H3"
    assert envelope.validation and envelope.exploration.failures(envelope.validation) == []
    run = mutator.load_run(tmp_path / "run", workspace=toycar)
    assert run.seal and run.verify().differences == ()
    assert run.findings == () and run.envelopes[0].curve.equals(envelope.curve)
    report = run.report().markdown.read_text(encoding="utf-8")
    assert "counts of experiments are no rates" in report and "; 95 % interval" not in report
    [again] = explore(toycar, tmp_path / "run")
    assert again.as_json() == envelope.as_json()
    assert mutator.load_run(tmp_path / "run", workspace=toycar).seal == run.seal


@pytest.mark.usefixtures("kept_checks")
def test_shrinking_takes_what_the_envelope_has(toycar: Workspace, finished_run: Path, tmp_path: Path) -> None:
    """At most three runs: the smallest cell with the hazard, and its neighbours on both axes without it."""
    shutil.copytree(finished_run, tmp_path / "run")
    [envelope] = explore(toycar, tmp_path / "run")
    run = mutator.load_run(tmp_path / "run", workspace=toycar)
    results = envelope.exploration.map.results
    largest = results[max(cell for cell, result in results.items() if result.state is CellState.HAZARDOUS)]
    smallest = run.experiment(largest.experiment_id).shrink()
    assert smallest.runs <= 3 and smallest.hazard == "H3"
    assert isinstance(smallest.experiment.fault.value, float) and smallest.duration_s
    assert smallest.experiment.fault.value in envelope.magnitudes
    assert smallest.duration_s in envelope.durations_s
    assert set(smallest.neighbours) == {"duration", "size"}
    out = tmp_path / "shrunk" / f"run-{largest.experiment_id}"
    assert out.exists() is (smallest.runs > 0)
    records = dict(run.records) | (dict(mutator.load_run(out).records) if smallest.runs else {})
    assert "H3" in dict(records[smallest.experiment.id].hazards)
    assert all("H3" not in dict(records[e.id].hazards) for e in smallest.neighbours.values())
    assert mutator.verify(smallest.run, workspace=toycar).passed


@pytest.mark.usefixtures("kept_checks", "without_figures")
def test_what_is_survived_is_challenged(toycar: Workspace, tmp_path: Path) -> None:
    """Errors that change were driven at each bound, under names of their own; a lowered bound has a run that
    shows it, and the page links it.
    """
    [envelope] = explore(toycar, tmp_path / "run", points=6, validation=0)
    assert envelope.challenges and envelope.exploration.is_complete
    run = mutator.load_run(tmp_path / "run", workspace=toycar)
    names = {run.experiment(name).fault.spec for name in run.records}
    assert {SPEC, f"{SPEC}~ramp", f"{SPEC}~noise", f"{SPEC}~alternating_0.5s", f"{SPEC}~glitch"} <= names
    challenges = envelope.exploration.challenges
    assert len(run.records) == envelope.run_count + len(challenges.results)
    page = run.report().page.read_text()
    for challenge in envelope.challenges:
        cell = challenge.bound.cell if challenge.level is None else challenge.bound.cell_at(challenge.level)
        assert challenge.level is None or all(
            result.state is CellState.WITHOUT_HAZARD
            for (other, _), result in challenges.results.items()
            if other == cell
        )
        if challenge.is_lowered:
            assert challenge.result and challenge.result.experiment_id in page
    assert run.verify().differences == ()


@pytest.mark.usefixtures("kept_checks")
def test_challengers_can_be_left_out(toycar: Workspace, tmp_path: Path) -> None:
    options = {"points": 4, "longest_s": 3.0, "observe_s": 0.5, "validation": 0, "workspace": toycar}
    [envelope] = mutator.envelope(SPEC, "A", 1, tmp_path / "run", challengers=[], **options)
    run = mutator.load_run(tmp_path / "run", workspace=toycar)
    assert envelope.challenges == [] and len(run.records) == envelope.run_count
    with pytest.raises(mutator.MutatorError, match="'jump'"):
        mutator.envelope(SPEC, "A", 1, tmp_path / "other", challengers=["jump"], **options)


@pytest.mark.usefixtures("kept_checks", "without_figures")
def test_a_controller_that_gives_up_has_not_survived(toycar: Workspace, tmp_path: Path) -> None:
    """One that is disengaged once it has steered hard survives errors up to 0.6 m, of the 1 m without."""
    manifest = toycar.library / "targets" / "toycar.yaml"
    manifest.write_text(f"{manifest.read_text()}engaged: not ever(abs(wheel_turn) > 0.4)\n")
    [envelope] = explore(Workspace.find(root=toycar.library.parent), tmp_path / "run", validation=0)
    states = {state for line in envelope.cells for state in line}
    assert CellState.DISENGAGED in states and CellState.HAZARDOUS in states
    assert 0.4 < (envelope.largest_survived() or 0) < 0.65
    run = mutator.load_run(tmp_path / "run", workspace=toycar)
    assert "ended with the controller disengaged" in run.report().markdown.read_text()
    assert run.verify().differences == ()


@pytest.mark.usefixtures("kept_checks")
def test_a_random_fault_is_driven_with_several_seeds(toycar: Workspace, tmp_path: Path) -> None:
    """Each cell has a run for each, under a name of its own."""
    path = toycar.library / "faults" / "sensor" / "lane.yaml"
    path.write_text(path.read_text().replace("model: offset", "model: noise").replace("by_m", "std_m"))
    [envelope] = mutator.envelope(
        SPEC, "A", 1, tmp_path / "run", points=3, longest_s=1.0, observe_s=0.5, seeds=2, workspace=toycar
    )
    run = mutator.load_run(tmp_path / "run", workspace=toycar)
    faults = [run.experiment(name).fault for name in run.records]
    assert {fault.spec for fault in faults} == {SPEC, f"{SPEC}~seed_1"}
    assert len(faults) == 2 * envelope.run_count and not envelope.is_challenged
    assert run.verify().differences == ()


@pytest.mark.usefixtures("kept_checks")
@pytest.mark.parametrize(
    ("start", "text"), [("far", "does not record"), ("d_rel < 0", "does not record"), (99, "never meets")]
)
def test_a_start_that_does_not_come_is_refused(
    toycar: Workspace, tmp_path: Path, start: str | float, text: str
) -> None:
    """The golden run decides when a fault begins: nothing is planned unless it does."""
    with pytest.raises(mutator.MutatorError, match=text):
        mutator.envelope(SPEC, "A", start, tmp_path / "run", campaign="small", workspace=toycar)
    assert not (tmp_path / "run").exists()


@pytest.mark.usefixtures("kept_checks")
def test_the_command_says_what_is_survived(toycar: Workspace, tmp_path: Path) -> None:
    """One sentence and one row for each plane; as JSON, the cells."""
    words = [
        "envelope",
        SPEC,
        "--scenario",
        "A",
        "--at",
        "1",
        "--out",
        str(tmp_path / "run"),
        "--points",
        "4",
    ]
    words += ["--longest-s", "3", "--observe-s", "0.5", "--validation", "3", "--campaign", "small", "-n", "1"]
    words += ["--library", str(toycar.library), "--templates", str(toycar.templates)]
    result = CliRunner().invoke(app, words)
    assert result.exit_code == 0, result.output
    text = " ".join(result.output.split())  # lines are folded
    assert f"{SPEC} in A from 1 s: " in text and "no other cell is called without hazard" in text
    assert "hazard after" in text and "seal: " in text
    [values] = json.loads(CliRunner().invoke(app, [*words, "--json"]).stdout)
    assert values["spec"] == SPEC and len(values["cells"]) == 4


@pytest.mark.usefixtures("kept_checks")
def test_a_search_names_what_it_found(toycar: Workspace, tmp_path: Path) -> None:
    """A row for each fault, scenario and start with a hazard; the run is sealed, and verified."""
    words = ["search", "sensor/lane", "sensor/distance/longer", "-s", "A", "-s", "B", "--at", "1"]
    words += [
        "--budget",
        "14",
        "--longest-s",
        "3",
        "--campaign",
        "small",
        "--out",
        str(tmp_path / "run"),
        "-n",
        "1",
    ]
    words += ["--library", str(toycar.library), "--templates", str(toycar.templates)]
    result = CliRunner().invoke(app, words)
    assert result.exit_code == 0, result.output
    assert "findings in 4 planes" in result.output and "H3" in result.output and "seal: " in result.output
    rows = json.loads(CliRunner().invoke(app, [*words, "--json"]).stdout)
    assert {row["scenario"] for row in rows} == {"A", "B"}
    run = mutator.load_run(tmp_path / "run", workspace=toycar)
    assert len(run.records) == 14 and run.verify().differences == ()
    assert {f.result.experiment_id[:8] for f in run.findings} == {row["experiment"] for row in rows}
    assert run.envelopes == ()


@pytest.mark.usefixtures("kept_checks")
def test_a_budget_that_is_spent_spoils_no_finished_exploration(toycar: Workspace, tmp_path: Path) -> None:
    """What the folder answers costs nothing: the same envelopes, file and seal."""
    options = {"points": 4, "longest_s": 3.0, "observe_s": 0.5, "validation": 3, "campaign": "small"}
    first = mutator.envelope(SPEC, "A", 1, tmp_path / "run", workspace=toycar, **options)
    stored = (tmp_path / "run" / "envelopes.json").read_bytes()
    again = mutator.envelope(SPEC, "A", 1, tmp_path / "run", workspace=toycar, budget_s=0, **options)
    assert again[0].as_json() == first[0].as_json() and not again.note
    assert (tmp_path / "run" / "envelopes.json").read_bytes() == stored
    nothing = mutator.envelope(SPEC, "A", 2, tmp_path / "new", workspace=toycar, budget_s=0, **options)
    assert not nothing.envelopes and nothing.note


@pytest.mark.usefixtures("kept_checks")
def test_a_listed_zero_is_refused(toycar: Workspace, tmp_path: Path) -> None:
    """A fault of size 0 is none, so the spec is refused, rather than the value left out."""
    _list_values_of_lane(toycar, "[0.0, 2.5]")
    with pytest.raises(mutator.MutatorError, match="0 among the listed values"):
        mutator.envelope(SPEC, "A", 1, tmp_path / "run", workspace=toycar)


@pytest.mark.usefixtures("kept_checks")
def test_values_listed_in_any_order_are_explored_by_size(toycar: Workspace, tmp_path: Path) -> None:
    _list_values_of_lane(toycar, "[-2.5, -1.0, 1.0, 0.5, 2.5]")
    options = {"points": 3, "longest_s": 1.0, "observe_s": 0.5, "validation": 3}
    explored = mutator.envelope(SPEC, "A", 1, tmp_path / "run", workspace=toycar, **options)
    assert [each.plane.magnitudes for each in explored] == [[0.5, 1.0, 2.5], [-1.0, -2.5]]


def _list_values_of_lane(toycar: Workspace, values: str) -> None:
    path = toycar.library / "faults" / "sensor" / "lane.yaml"
    drawn = "reals_from: {first: [0.0, 0.1], step: 0.8, last: [2.4, 2.5]}\n        decimals: 2"
    assert drawn in path.read_text()
    path.write_text(path.read_text().replace(drawn, f"values: {values}"))


@pytest.mark.usefixtures("kept_checks")
def test_a_fault_that_is_never_active_is_not_called_survived(toycar: Workspace, tmp_path: Path) -> None:
    """And equal starts and scenarios are one plane."""
    path = toycar.library / "faults" / "sensor" / "lane.yaml"
    path.write_text(path.read_text().replace("function: Sensor.sense", "function: _add_never.never"))
    source = toycar.library.parent / "tree" / "toycar" / "sensing.py"
    never = "def _add_never():\n    def never(self):\n        offset = 0\n        return offset\n"
    source.write_text(f"{source.read_text()}\n\n{never}")
    explored = mutator.envelope(
        SPEC, ["A", "A"], [1, 1.0], tmp_path / "run", points=3, longest_s=1.0, observe_s=0.5, workspace=toycar
    )
    [envelope] = explored
    assert envelope.plane.start == "1"
    assert "never active" in describe_envelope(envelope)


_CAMPAIGN = """
schema: campaign/1
name: exploring
about: How wrong the lane sensor may be.
target: toycar
scenarios: [A]
faults: [{spec: sensor/lane/*}]
explore: {goal: envelope, starts: [1], points: 4, longest_s: 3, observe_s: 0.5, validation: 2}
seed: 3
canary: {spec: sensor/lane/shifted, scenario: A, hazard: H3, at_s: 0.5}
"""


@pytest.mark.usefixtures("kept_checks")
def test_a_campaign_explores(toycar: Workspace, tmp_path: Path) -> None:
    """`run` explores, and resumes with nothing to do; verbs that need a plan, and filters, are refused."""
    path = tmp_path / "exploring.yaml"
    path.write_text(_CAMPAIGN.replace("points: 4", "points: 4, challengers: [ramp], seeds: 2"))
    run = mutator.run(path, tmp_path / "run", workspace=toycar)
    assert all(envelope.plane.challengers == ("ramp",) for envelope in run.envelopes)
    assert run.summary and run.summary.exit_code == 0 and run.seal and len(run.records) > 8
    assert run.folder.head.campaign == "exploring"
    assert mutator.run(path, tmp_path / "run", workspace=toycar).seal == run.seal
    with pytest.raises(mutator.MutatorError, match="results decide which experiments follow"):
        mutator.plan(path, workspace=toycar)
    with pytest.raises(mutator.MutatorError, match="`limit` for campaign exploring, which explores"):
        mutator.run(path, tmp_path / "other", choices=mutator.Choices(limit=3), workspace=toycar)
    with pytest.raises(mutator.MutatorError, match="`series_mb` for campaign exploring, which explores"):
        mutator.run(path, tmp_path / "other", choices=mutator.Choices(series_mb=0), workspace=toycar)


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        ("seed: 3", "seed: 3\ntriggers: [always]", "no `triggers` with `explore`"),
        ("seed: 3", "seeds: {from: 1, to: 2}", "no `seeds` with `explore`"),
        ("seed: 3", "seed: 3\ninclude: hazard_without_fault", "no `include` with `explore`"),
        ("seed: 3", "seed: 3\nafter_hazard: stop", "no `after_hazard` with `explore`"),
        ("starts: [1]", "starts: [-1]", "times in s from 0 on"),
        ("longest_s: 3", "longest_s: 0.01", "longest_s"),
        ("spec: sensor/lane/*", "spec: sensor/lane/*, values: 3", "without `values`, with `explore`"),
        ("starts: [1]", "starts: []", "starts"),
        ("points: 4", "points: 4, challengers: [jump]", "challengers"),
        ("points: 4", "points: 4, seeds: 0", "seeds"),
    ],
)
def test_an_exploring_campaign_is_checked(
    toycar: Workspace, tmp_path: Path, old: str, new: str, text: str
) -> None:
    path = tmp_path / "exploring.yaml"
    path.write_text(_CAMPAIGN.replace(old, new))
    with pytest.raises(mutator.MutatorError, match=text):
        mutator.run(path, tmp_path / "run", workspace=toycar)


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["sensor/lane/shift"], "no fault 'sensor/lane/shift'"),
        ([SPEC, "--scenario", "Z"], "no scenario 'Z'"),
        ([SPEC, "--at", "soon"], "no context 'soon'"),
    ],
)
def test_wrong_words_are_refused(toycar: Workspace, tmp_path: Path, words: list[str], text: str) -> None:
    """The error names what was got; no folder is left behind."""
    rest = ["--library", str(toycar.library), "--templates", str(toycar.templates)]
    defaults = {"--scenario": "A", "--at": "1"}
    rest += [word for name, value in defaults.items() if name not in words for word in (name, value)]
    result = CliRunner().invoke(app, ["envelope", *words, "--out", str(tmp_path / "run"), *rest])
    assert isinstance(result.exception, mutator.MutatorError) and text in str(result.exception)
    assert not (tmp_path / "run").exists()


def begin(workspace: Workspace, out: Path, workers: int) -> subprocess.Popen[bytes]:
    words = [str(workspace.library.parent), str(out), str(workers)]
    return subprocess.Popen([sys.executable, "-c", _EXPLORE, *words], start_new_session=True)


@pytest.mark.slow
@pytest.mark.usefixtures("kept_checks")
def test_kills_and_workers_change_nothing(toycar: Workspace, tmp_path: Path) -> None:
    """Killed at random moments and resumed, with one worker, two and four: the same seal."""
    assert begin(toycar, tmp_path / "1", 1).wait(900) == 0
    alone = mutator.load_run(tmp_path / "1", workspace=toycar)
    for workers in (2, 4):
        assert begin(toycar, tmp_path / str(workers), workers).wait(900) == 0
    out, rng = tmp_path / "killed", random.Random(5)
    for _ in range(_KILLS):
        process = begin(toycar, out, 2)
        try:
            process.wait(rng.uniform(2.0, 9.0))
        except subprocess.TimeoutExpired:
            os.kill(process.pid, signal.SIGKILL)
            process.wait()
    assert begin(toycar, out, 2).wait(900) == 0
    for name in ("2", "4", "killed"):
        run = mutator.load_run(tmp_path / name, workspace=toycar)
        assert run.seal == alone.seal is not None
        assert dict(load_records(tmp_path / name)) == dict(load_records(tmp_path / "1"))
        shutil.rmtree(tmp_path / name)
