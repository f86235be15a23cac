"""The whole quickstart on the shipped controller and the results that it must show."""

import csv
from collections import Counter
from pathlib import Path

import pytest

from mutator.execution.campaign_running import run_campaign
from mutator.outcomes.hazard_and_metric_judgement import formula_values_by_name
from mutator.outcomes.trace_and_record_loading import load_trace
from mutator.triggers.trace_formulas import condition_at_each_step
from mutator.workspace import Workspace

pytestmark = pytest.mark.slow

CONTEXTS = {"S1": 3, "S2": 4, "S3": 4, "S4": 4, "S5": 3}
Row = dict[str, str]


@pytest.fixture(scope="module")
def workspace() -> Workspace:
    return Workspace.find(root=Path(__file__).parents[2])


@pytest.fixture(scope="module")
def quickstart(workspace: Workspace, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("quickstart") / "run"
    summary = run_campaign(workspace, "quickstart", out, workers=2)
    assert (summary.exit_code, summary.done) == (0, 60)
    return out


@pytest.fixture(scope="module")
def rows(quickstart: Path) -> list[Row]:
    return list(csv.DictReader((quickstart / "results.csv").open()))


def test_every_run_ends_well_and_every_outcome_occurs(rows: list[Row]) -> None:
    assert Counter(row["status"] for row in rows) == {"ok": 60}
    assert {row["outcome"] for row in rows} == {"hazard", "sdc", "masked", "not_activated"}
    assert all(any(row[name] == "1" for row in rows) for name in ("h1", "h2", "h3"))


def test_no_run_brakes_harder_than_the_controller_can(rows: list[Row]) -> None:
    """H4 needs a driver or an emergency brake beside the controller, which no undefended run has."""
    assert {(row["h4"], row["t_h4"], row["needless_braking"]) for row in rows} == {("0", "", "0.0")}
    assert min(float(row["margin_h4"]) for row in rows) > 0.0


@pytest.mark.parametrize(
    ("fault_type", "alerts"),
    [("jamming", {"can_error", "radar_error"}), ("camera_unavailable", {"model_error"})],
)
def test_lost_radar_or_camera_data_raise_an_alert_within_0_6_s(
    rows: list[Row], fault_type: str, alerts: set[str]
) -> None:
    active = [row for row in rows if row["fault_type"] == fault_type and row["activated"] == "1"]
    assert active
    for row in active:
        assert row["alerts"].split(";")[0] in alerts
        assert float(row["t_alert"]) - float(row["t_activation"]) <= 0.6


def test_a_wrong_camera_distance_alone_changes_little(rows: list[Row]) -> None:
    def manifested(module: str, fault_type: str) -> list[str]:
        return [
            row["manifested"]
            for row in rows
            if (row["module"], row["fault_type"], row["activated"]) == (module, fault_type, "1")
        ]

    assert set(manifested("vision_output", "relative_distance")) == {"0"}
    assert set(manifested("radar", "chaff")) == {"1"}


def test_times_are_in_order(rows: list[Row]) -> None:
    for row in rows:
        for name in ("t_manifest", "t_h1", "t_h2", "t_h3", "t_alert"):
            assert not row[name] or float(row[name]) >= float(row["t_activation"])
        assert not row["reaction_time"] or float(row["reaction_time"]) > 0.0


@pytest.mark.parametrize("scenario", sorted(CONTEXTS))
def test_golden_runs_reach_the_contexts_of_the_original(
    quickstart: Path, workspace: Workspace, scenario: str
) -> None:
    manifest = workspace.manifest("openpilot")
    trace = load_trace(manifest, quickstart / "golden" / scenario)
    table = workspace.context_table("accelerate_decelerate")
    values = formula_values_by_name(manifest, trace)
    armed = trace["t"] >= 1.5
    reached = [row.id for row in table.rows if (condition_at_each_step(row.condition, values) & armed).any()]
    assert len(reached) == CONTEXTS[scenario]
