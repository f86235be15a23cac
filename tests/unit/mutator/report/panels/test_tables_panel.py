"""The tables of a run, in its report and as files."""

import json
from pathlib import Path

import numpy as np
import pytest
from markupsafe import escape

from mutator.report.panel import Panel
from mutator.report.panels.tables_panel import build_tables_panel
from mutator.report.reported_run import ReportedRun
from mutator.results.severity_and_sentence_columns import TIME_TO_HAZARD_COLUMNS
from mutator.results.table_columns import result_columns
from mutator.store import plan_file
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace
from tests.made_head import made_head
from tests.made_up_results import write_results

HERE = Workspace.find(Path(__file__).parents[5])
HAZARD = {
    "fault_id": "a",
    "module": "radar",
    "fault_type": "chaff",
    "scenario": "S1",
    "trigger": "C2",
    "seed": 1,
    "status": "ok",
    "outcome": "hazard",
    "t_activation": 5,
    "t_manifest": 6,
    "h1": 1,
    "t_h1": 9,
    "alerts": "fcw",
    "t_alert": 8,
    "reaction_time": 1,
}


@pytest.fixture
def run(tmp_path: Path) -> RunFolder:
    head = made_head(goldens=[["S1", []]], hazards=["H1"])
    (tmp_path / "run.json").write_text(json.dumps(head))
    plan_file.write_plan(tmp_path, [], [])
    lines = [HAZARD | {"experiment_id": method, "method": method} for method in ("guided", "random")]
    write_results(tmp_path, result_columns(("H1",), (), (), TIME_TO_HAZARD_COLUMNS), lines)
    (tmp_path / "golden" / "S1").mkdir(parents=True)
    np.savez(tmp_path / "golden" / "S1" / "trace.npz", t=np.arange(3000) / 100)
    return RunFolder.open_unverified(tmp_path)


def names(panel: Panel, suffix: str) -> set[str]:
    return {Path(name).stem for name in panel.files if name.endswith(suffix)}


def test_every_table_is_written_in_csv_and_markdown(run: RunFolder) -> None:
    panel = build_tables_panel(ReportedRun.open(run, HERE))
    assert "alert_to_hazard" in names(panel, "md") == names(panel, "csv")
    for name, data in panel.files.items():
        assert name.endswith(".csv") or data.decode().rstrip() in panel.markdown


def test_without_a_library_no_time_is_censored(run: RunFolder) -> None:
    """Without the target's manifest, the ends of runs are unknown."""
    panel = build_tables_panel(ReportedRun.open(run, None))
    assert "propagation" in names(panel, "csv")
    assert "alert_to_hazard" not in names(panel, "csv")


def test_tables_are_reproducible(run: RunFolder) -> None:
    panel, again = (build_tables_panel(ReportedRun.open(run, HERE)) for _ in range(2))
    assert panel.files == again.files


def test_tables_of_alerts_mention_the_alerts_of_fault_free_runs(run: RunFolder) -> None:
    golden = run.path / "golden" / "S1"
    channels = ("d_rel", "v_ego", "v_lead", "a_ego", "hwt", "long_state", "gas", "brake")
    drive = {name: np.ones(3000) for name in channels}
    drive |= {"t": np.arange(3000) / 100, "lateral_offset": np.linspace(-0.25, 0.5, 3000)}
    np.savez(golden / "trace.npz", **drive)
    record = {"hazards": {"H1": None}, "alerts": [{"name": "steer_saturated", "t": 12.29}]}
    (golden / "record.json").write_text(json.dumps(record))
    panel = build_tables_panel(ReportedRun.open(run, HERE))
    note = "Not every alert is caused by a fault: fault-free runs raise steer_saturated in S1."
    assert panel.html.count(str(escape(note))) == panel.markdown.count(note) >= 6
    assert "| S1 | steer_saturated at 12.29 s | none | 1 to 1 |" in panel.markdown
    assert note in panel.files["tables/summary_guided.md"].decode()
    assert note not in panel.files["tables/hazard_orders.md"].decode()


@pytest.mark.parametrize("alerts", [["fcw"], []])
def test_a_target_without_alerts_has_no_alert_tables(run: RunFolder, alerts: list[str]) -> None:
    head = json.loads((run.path / "run.json").read_text()) | {"alerts": alerts}
    (run.path / "run.json").write_text(json.dumps(head))
    markdown = build_tables_panel(ReportedRun.open(RunFolder.open_unverified(run.path), HERE)).markdown
    assert ("no alert" in markdown.lower()) == bool(alerts)
