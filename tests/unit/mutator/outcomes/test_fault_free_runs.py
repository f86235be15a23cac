"""The hazards, alerts and channel ranges of fault-free runs."""

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mutator.errors import MutatorError
from mutator.outcomes.fault_free_runs import fault_free_alerts_note, fault_free_table, load_fault_free_runs
from mutator.store.run_folder import RunFolder
from mutator.targets.channels import Channel
from mutator.targets.hazard_and_metric_definitions import Hazard
from tests.made_head import made_head

MANIFEST: Any = SimpleNamespace(
    trace_file="trace.npz",
    record_file="record.json",
    time_channel="t",
    hazard_rules=(Hazard(name="H1"),),
    metrics=(),
    contact=None,
    criteria_channels=(),
    channels=(),
    observation=SimpleNamespace(derived=()),
    engaged="",
    alerts=("fcw", "late"),
    non_actuator_channels=(Channel(name="v", unit="m/s"), Channel(name="not_recorded", unit="m")),
)


def folder(path: Path, runs: dict[tuple[str, str], dict]) -> RunFolder:
    """Create a run folder whose golden runs have the given records, by scenario and change."""
    goldens = [[scenario, [change] if change else []] for scenario, change in runs]
    (path / "run.json").write_text(json.dumps(made_head(goldens=goldens)))
    made = RunFolder.open_unverified(path)
    for (scenario, changes), record in zip(goldens, runs.values(), strict=True):
        place = made.golden_folder(scenario, tuple(changes))
        place.mkdir(parents=True)
        (place / "record.json").write_text(json.dumps(record))
        np.savez(place / "trace.npz", t=np.arange(3.0), v=np.array([2.0, np.nan, -1.0]))
    return made


def test_the_table_has_first_times_of_events_and_ranges_of_channels(tmp_path: Path) -> None:
    raised = [{"name": "fcw", "t": 3.5}, {"name": "fcw", "t": 9.0}, {"name": "chime", "t": 1.0}]
    runs = load_fault_free_runs(
        folder(
            tmp_path,
            {("B", ""): {"hazards": {"H1": 7.0}, "alerts": raised}, ("A", "rain"): {"hazards": {}}},
        ),
        MANIFEST,
    )
    assert [(run.scenario, run.changes) for run in runs] == [("A", ("rain",)), ("B", ())]
    assert runs[1].channel_ranges == (("v", -1.0, 2.0),)
    table = fault_free_table(runs)
    assert list(table.heads) == ["fault-free run", "alerts", "hazards", "v"]
    assert list(table.rows[0]) == ["A+rain", "none", "none", "-1 to 2"]
    assert list(table.rows[1]) == ["B", "fcw at 3.50 s", "H1 at 7.00 s", "-1 to 2"]


def test_the_sentence_names_each_alert_once_with_its_scenarios(tmp_path: Path) -> None:
    fcw = {"hazards": {}, "alerts": [{"name": "fcw", "t": 3.5}]}
    late = {"hazards": {}, "alerts": [{"name": "late", "t": 3.5}]}
    runs = load_fault_free_runs(
        folder(tmp_path, {("A", ""): fcw, ("A", "rain"): fcw, ("B", ""): fcw, ("C", ""): late}), MANIFEST
    )
    assert fault_free_alerts_note(runs).endswith("fault-free runs raise fcw in A, B; late in C.")
    assert fault_free_alerts_note(()) == ""


def test_a_missing_golden_run_is_an_error(tmp_path: Path) -> None:
    made = folder(tmp_path, {("A", ""): {"hazards": {}}})
    (made.golden_folder("A") / "record.json").unlink()
    with pytest.raises(MutatorError, match="golden"):
        load_fault_free_runs(made, MANIFEST)
