"""Runs of an exploration end once they were observed for long enough, where the target can stop a run."""

from dataclasses import replace
from pathlib import Path

import pytest

import mutator
from mutator.model import AfterHazard, Experiment
from mutator.store import plan_file
from mutator.workspace import Workspace
from tests.e2e.exploration_forging import Reseal, check_of, replace_in_batch

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


@pytest.mark.usefixtures("kept_checks")
def test_runs_end_once_they_were_observed(stopping: Workspace, tmp_path: Path, reseal: Reseal) -> None:
    """Verdicts are those of whole runs; the end is part of the plan, and an edited one is found."""
    out = tmp_path / "run"
    [envelope] = mutator.envelope(
        "sensor/lane/shifted",
        "A",
        START_S,
        out,
        points=6,
        longest_s=2.0,
        observe_s=OBSERVE_S,
        validation=4,
        campaign="small",
        workspace=stopping,
    )
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
