"""The sentences of a run say what its traces show."""

import json
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import mutator
from mutator.api.runs import Run
from mutator.execution.campaign_running import run_campaign
from mutator.results.table_reader import Results
from mutator.workspace import Workspace
from tests.sentence_check import Drive, wrong_claims

pytestmark = pytest.mark.slow
# what each falsification replaces in a sentence, and with what
FALSIFICATIONS = {
    r"further left": "further right", r"brakes less": "brakes harder", r"gives more": "gives less",
    r" at first, then [a-z ]+(?=[.,]| and)": "", r"(?<=car gives more gas)(?= and|\.)": " at first",
    r"accelerates to": "slows to", r"slows to": "accelerates to", r"No alert": "Alert fcw at 3 s",
    r" No hazard follows\.": "", r"changes no actuator": "brakes less",
    r"touches": "leaves", r"(?<= from )[0-9.]+": "77", r"[0-9.]+(?= s later)": "77", r"[0-9.]+(?= m/s)": "77",
}  # fmt: skip


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    out = tmp_path_factory.mktemp("sentences") / "run"
    workspace = Workspace.find(root=Path(__file__).parents[2])
    assert run_campaign(workspace, "quickstart", out, workers=2).done == 60
    return mutator.load_run(out)


def test_numbers_and_directions_follow_from_the_traces(run: Run) -> None:
    """Code that knows only the traces finds nothing wrong in a sentence, and something in each false one."""
    for row in Results.up_to_date(run.path).rows():
        experiment = run.experiment(row.experiment_id)
        trial = experiment.rerun()
        traces, alerts = trial.traces(), json.loads((trial.single.faulty / "record.json").read_text())
        value = experiment.fault.value
        drive = Drive(
            faulty=_channels(traces.faulty),
            golden=_channels(traces.golden),
            activation_s=row.t_activation,
            alerts=[(alert["name"], alert["t"]) for alert in alerts["alerts"]],
            value=value if isinstance(value, int | float) else None,
            condition=experiment.trigger.condition,
        )
        assert (experiment.sentence, wrong_claims(experiment.sentence, drive)) == (row.sentence, [])
        for pattern, replacement in FALSIFICATIONS.items():
            false = re.sub(pattern, replacement, row.sentence)
            assert false == row.sentence or wrong_claims(false, drive), false


def _channels(frame: pd.DataFrame) -> dict[str, np.ndarray]:
    return {"t": frame.index.to_numpy()} | {str(name): frame[name].to_numpy() for name in frame}
