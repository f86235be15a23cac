"""The sentences of a run say what its traces show."""

import json
import re
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

import pandas as pd
import pytest

import mutator
from mutator.api.runs import Run
from mutator.execution.campaign_running import run_campaign
from mutator.results.table_reader import Results
from mutator.workspace import Workspace
from tests.sentence_check import Channels, Drive, Loop, wrong_claims
from tests.sentence_loops import CARTPOLE, HIGHWAY, OPENDBC, OPENPILOT

pytestmark = pytest.mark.slow
# what each falsification replaces in a sentence, and with what
FALSIFICATIONS = {
    r"further left": "further right", r"brakes less": "brakes harder", r"gives more": "gives less",
    r" at first, then [a-z ]+(?=[.,]| and)": "", r"(?<=car gives more gas)(?= and|\.)": " at first",
    r"accelerates to": "slows to", r"slows to": "accelerates to", r"No alert": "Alert fcw at 3 s",
    r" No hazard follows\.": "", r"changes no actuator": "brakes less",
    r", accelerates to [0-9.]+ m/s": "", r"touches": "leaves", r"falls": "stands", r"hits": "leaves",
    r"(accelerates|gives) more": r"\1 less", r"(?<= from )[0-9.]+": "77", r"[0-9.]+(?= s later)": "77",
    r"[0-9.]+(?= m/s)": "77",
}  # fmt: skip
OF_A_CLAUSE = {r"too far right": "too far left", r"too high": "too low", r"[0-9.]+(?= s late from)": "77"}
ROOT = Path(__file__).parents[2]
EXAMPLES = {
    "cartpole": (CARTPOLE, "simple_pid"),
    "highway": (HIGHWAY, "highway_env"),
    "opendbc": (OPENDBC, "opendbc"),
}  # with the package that each needs


@dataclass(frozen=True)
class Case:
    """A campaign, and the words of its library."""

    workspace: Workspace
    campaign: str
    experiments: int
    loop: Loop


@pytest.fixture(params=["quickstart", *EXAMPLES])
def case(request: pytest.FixtureRequest) -> Case:
    name: str = request.param
    if name == "quickstart":
        return Case(Workspace.find(root=ROOT), name, 60, OPENPILOT)
    loop, package = EXAMPLES[name]
    if find_spec(package) is None:
        pytest.skip(f"no {package} here: pip install 'mutator-fi[examples]'")
    return Case(Workspace.find(library=ROOT / "examples" / name / "fault_library"), "first", 48, loop)


def test_numbers_and_directions_follow_from_the_traces(case: Case, tmp_path: Path) -> None:
    """Code that knows only the traces finds nothing wrong in a sentence, and something in each false one."""
    done = run_campaign(case.workspace, case.campaign, tmp_path / "run", workers=2).done
    assert done == case.experiments
    run = mutator.load_run(tmp_path / "run", workspace=case.workspace)
    for row in Results.up_to_date(run.path).rows():
        drive = _drive(run, row.experiment_id, case.loop)
        sentence = run.experiment(row.experiment_id).sentence
        assert (sentence, wrong_claims(sentence, drive)) == (row.sentence, [])
        falsifications = FALSIFICATIONS | (OF_A_CLAUSE if case.loop.clauses else {})
        for pattern, replacement in falsifications.items():
            false = re.sub(pattern, replacement, sentence)
            assert false == sentence or wrong_claims(false, drive), false


def _drive(run: Run, experiment_id: str, loop: Loop) -> Drive:
    """Return what a rerun of an experiment recorded."""
    experiment = run.experiment(experiment_id)
    trial = experiment.rerun()
    traces, record = trial.traces(), json.loads((trial.single.faulty / "record.json").read_text())
    value, first = experiment.fault.value, trial.record.activation
    return Drive(
        loop=loop,
        faulty=_channels(traces.faulty),
        golden=_channels(traces.golden),
        activation_s=first.first if first else None,
        alerts=[(alert["name"], alert["t"]) for alert in record.get("alerts", [])],
        value=value if isinstance(value, int | float) else None,
        variant=experiment.fault.spec.split("/")[-1],
        condition=experiment.trigger.condition,
    )


def _channels(frame: pd.DataFrame) -> Channels:
    return {"t": frame.index.to_numpy()} | {str(name): frame[name].to_numpy() for name in frame}
