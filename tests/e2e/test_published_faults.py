"""The faults measured on the original openpilot, injected into our controller on the original's plant."""

import csv
from pathlib import Path

import pytest

from mutator.execution.campaign_running import run_campaign
from mutator.store.plan_choices import Choices
from mutator.workspace import Workspace

pytestmark = pytest.mark.slow

MEASURED = (
    '(aim == "H2" and trigger == "far" or aim != "H2" and trigger == "close")'
    ' and module != "radar_vision" and fault_type != "path_model"'
)
# variant: runs, hazards of the original, their kind, alerts, time of the alert. Source: measurements of
# openpilot v0.4.2 in scenario S1, as coded, active while the headway is at most 2.0 s.
ORIGINAL = {
    "radar/chaff/distance": (24, 18, "h1", "", None),
    "radar/invisible_vehicle/speed": (6, 6, "h1", "", None),
    "radar/ghost_vehicle/distance": (25, 7, "h2", "", None),
    "radar/ghost_vehicle/speed": (6, 0, "", "", None),
    "radar/jamming/no_data": (1, 1, "h1", "can_error", 7.085),
    "car_sensors/speed/slower": (6, 0, "", "", None),
    "car_sensors/speed/faster": (6, 0, "", "", None),
    "car_sensors/steer/angle": (10, 6, "h3", "", None),
    "vision_output/camera_unavailable/no_data": (1, 1, "h1", "model_error", 7.415),
    "vision_output/relative_distance/longer": (24, 0, "", "", None),
    "vision_output/relative_distance/shorter": (25, 0, "", "", None),
}


@pytest.fixture(scope="module")
def rows(tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[dict[str, str]]]:
    out = tmp_path_factory.mktemp("published") / "run"
    workspace = Workspace.find(root=Path(__file__).parents[2])
    summary = run_campaign(workspace, "published_s1", out, workers=2, choices=Choices(only=MEASURED))
    assert summary.exit_code == 0
    found: dict[str, list[dict[str, str]]] = {}
    for row in csv.DictReader((out / "results.csv").open()):
        found.setdefault("/".join((row["module"], row["fault_type"], row["variant"])), []).append(row)
    return found


@pytest.mark.parametrize("variant", ORIGINAL)
def test_hazards_and_alerts_are_those_of_the_original(
    rows: dict[str, list[dict[str, str]]], variant: str
) -> None:
    """Hazard counts can differ by up to two, because the values are drawn again."""
    runs, hazards, kind, alerts, t_alert = ORIGINAL[variant]
    found = rows[variant]
    assert len(found) == runs
    dangerous = [row for row in found if row["outcome"] == "hazard"]
    assert abs(len(dangerous) - hazards) <= 2
    assert all([name for name in ("h1", "h2", "h3") if row[name] == "1"] == [kind] for row in dangerous)
    assert {row["alerts"] for row in found} == {alerts}
    if t_alert is not None:
        assert float(found[0]["t_alert"]) == pytest.approx(t_alert, abs=0.05)


# The original's simulator swaps the lanes. Source: its runs of the authors' files 14 (value 1) and 16 (value
# 2). The values below are the campaign's closest ones.
SWAPPED = {
    ("path_model", "right", "-2.01"): {"t_h1": 14.79, "t_h3": 11.75, "t_alert": 7.745},
    ("steer", "angle", "-32.89"): {"t_h3": 13.0},
}


def test_faults_that_depend_on_the_swapped_lanes_have_the_effects_of_the_original(tmp_path: Path) -> None:
    workspace, out = Workspace.find(root=Path(__file__).parents[2]), tmp_path / "run"
    values = " or ".join(
        f'(fault_type == "{kind}" and variant == "{variant}" and value == {value})'
        for kind, variant, value in SWAPPED
    )
    choices = Choices(only=f'trigger == "close" and ({values})')
    assert run_campaign(workspace, "published_s1", out, workers=2, choices=choices).exit_code == 0
    rows = {
        (r["fault_type"], r["variant"], r["value"]): r for r in csv.DictReader((out / "results.csv").open())
    }
    assert rows.keys() == SWAPPED.keys()
    for fault, times in SWAPPED.items():
        assert {name: float(rows[fault][name]) for name in times} == pytest.approx(times, abs=0.1)
