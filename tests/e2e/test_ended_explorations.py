"""Runs of an exploration end once they were observed for long enough, where the target can stop a run."""

from collections import Counter
from dataclasses import replace
from pathlib import Path

import pytest

import mutator
from mutator.errors import MutatorError
from mutator.model import AfterHazard, Experiment, Outcome
from mutator.store import plan_file
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace
from tests.e2e.exploration_forging import Reseal, check_of, edit_record, replace_in_batch

START_S, OBSERVE_S = 1.0, 0.5
HAZARDS = """\
hazards:
  H1: {about: contact, when: gap < 0.5, terminal: true}
  H3: {about: out of the lane, when: "abs(offset) > 1.0", terminal: true}
  TOO_FAST: {about: too fast, when: speed > 100}
"""
RECORDED = """
    def recorded(self):
        names = ("time", "gap", "speed", "lead_speed", "offset", "gas", "brake", "wheel_turn")
        return dict(zip(names, self.rows[-1], strict=True))

    def write("""


@pytest.fixture
def stopping(toycar: Workspace) -> Workspace:
    """The toy with a hazard that can end a run between two steps."""
    manifest = toycar.library / "targets" / "toycar.yaml"
    text = manifest.read_text()
    channel = "  speed: {unit: m/s, role: truth}\n"
    text = text.replace(channel, f"{channel}  offset: {{unit: m, role: truth}}\n")
    manifest.write_text(text.replace("hazards: [H1, H3, TOO_FAST]\n", HAZARDS))
    module = toycar.library.parent / "tree" / "toycar" / "go.py"
    module.write_text(module.read_text().replace("\n    def write(", RECORDED))
    return toycar


def explore(workspace: Workspace, out: Path) -> mutator.Envelopes:
    return mutator.envelope(
        "sensor/lane/shifted",
        "A",
        START_S,
        out,
        points=6,
        longest_s=2.0,
        observe_s=OBSERVE_S,
        validation=4,
        campaign="small",
        workspace=workspace,
    )


@pytest.mark.usefixtures("kept_checks")
def test_runs_end_once_they_were_observed(stopping: Workspace, tmp_path: Path, reseal: Reseal) -> None:
    """Verdicts are those of whole runs; the end is part of the plan, and an edited one is found."""
    out = tmp_path / "run"
    [envelope] = explore(stopping, out)
    experiments = plan_file.load_experiments(out)
    assert {e.after_hazard for e in experiments} == {AfterHazard.STOP}
    for experiment in experiments:
        assert experiment.end_s == round(START_S + (experiment.trigger.hold_s or 0.0) + OBSERVE_S, 6)
    assert any(state.is_hazardous for line in envelope.cells for state in line)
    run = mutator.load_run(out, workspace=stopping)
    assert run.verify().differences == ()

    def later(experiment: Experiment) -> Experiment:
        return replace(experiment, end_s=(experiment.end_s or 0.0) + 1.0)

    replace_in_batch(out, 1, 0, later)
    reseal(out)
    assert "up to" in str(check_of(out, stopping))


@pytest.mark.usefixtures("kept_checks")
def test_runs_without_an_active_fault_are_compared_with_each_other(
    stopping: Workspace, tmp_path: Path, reseal: Reseal
) -> None:
    """Their traces are shorter than golden's: an honest one is no difference, another one is."""
    root = stopping.library.parent
    module = root / "tree" / "toycar" / "sensing.py"
    late = "        if len(self.seen) > 60:\n            shift = 0.0\n            offset = offset + shift\n"
    text = module.read_text().replace(
        "        self.publish((gap", f"{late}        self.seen.append(0)\n        self.publish((gap"
    )
    start = "self.reading = (100.0, 0.0, 0.0)\n"
    module.write_text(text.replace(start, f"{start}        self.seen = []\n", 1))
    spec = stopping.library / "faults" / "sensor" / "lane.yaml"
    spec.write_text(spec.read_text().replace("after_assign: offset}", "after_assign: shift}"))
    out = tmp_path / "run"
    explore(stopping, out)
    records = RunFolder.open(out).records().values()
    assert {record.outcome for record in records} == {Outcome.NOT_ACTIVATED}
    assert mutator.verify(out, workspace=stopping).differences == ()
    twins = Counter(e.end_s for e in plan_file.load_experiments(out))
    assert max(twins.values()) > 1
    end_s = max(twins, key=lambda end_s: twins[end_s])
    forged = next(e.id for e in plan_file.load_experiments(out) if e.end_s == end_s)
    edit_record(out, lambda record: record["experiment_id"] == forged, trace_digest="0" * 64)
    reseal(out)
    differences = mutator.verify(out, workspace=stopping).differences
    assert any("which ended at the same time" in str(difference) for difference in differences)


@pytest.mark.usefixtures("kept_checks")
def test_an_exploration_of_an_earlier_version_is_not_continued(
    stopping: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its runs end with their scenarios. The error says what to do."""
    out = tmp_path / "run"
    with monkeypatch.context() as earlier:
        earlier.setattr("mutator.api.exploration_benches.replace", lambda experiment, **_: experiment)
        explore(stopping, out)
    plan = (out / plan_file.EXPERIMENTS_FILE).read_bytes()
    for read in (lambda: explore(stopping, out), lambda: mutator.load_run(out, workspace=stopping).envelopes):
        with pytest.raises(MutatorError, match=r"ends with its scenario.*explore anew, into another folder"):
            read()
    assert (out / plan_file.EXPERIMENTS_FILE).read_bytes() == plan
