"""Counts that explain differences from the paper: each is of the right faults, method and time."""

import pandas as pd
import pytest

from mutator.paper.reproduction.explaining_counts import count_runs

COLUMNS = (
    "kind",
    "variant",
    "method",
    "row",
    "scenario",
    "t_activation",
    "t_manifest",
    "t_h1",
    "t_h3",
    "alerts",
)
RUNS = (
    ("car_sensors/speed", "slower", "guided", "C2", "S1", 5.0, 5.1, 9.0, 8.0, ""),
    ("car_sensors/speed", "slower", "guided", "C2", "S2", 5.0, 5.1, None, None, ""),
    ("car_sensors/speed", "slower", "random", "C2", "S1", 5.0, 5.1, 9.0, None, ""),
    ("radar/invisible_vehicle", "speed", "guided", "C4", "S1", 0.0, 0.1, 4.0, None, "fcw"),
    ("radar/invisible_vehicle", "speed", "guided", "C4", "S2", None, None, None, None, ""),
    ("radar/ghost_vehicle", "distance", "guided", "C3", "S1", 3.0, None, None, None, ""),
    ("vision_output/path_model", "left", "random", "C2", "S1", 23.99, 24.1, None, 25.0, "steer_saturated"),
    ("vision_output/path_model", "left", "random", "C2", "S2", 24.0, 24.1, None, None, ""),
    ("vision_output/path_model", "left", "guided", "C2", "S1", 5.0, 5.1, None, 7.0, "steer_saturated"),
    ("vision_output/relative_distance", "longer", "random", "C2", "S1", 5.0, None, None, None, ""),
    ("vision_input/rain", "rain", "guided", "C2", "S1", 5.0, None, None, None, "steer_saturated;fcw"),
    ("vision_input/rain", "rain", "guided", "C2", "S1", 5.0, 6.0, None, None, ""),
)


@pytest.fixture
def frame() -> pd.DataFrame:
    frame = pd.DataFrame(RUNS, columns=COLUMNS)
    frame["module"] = frame["kind"].str.partition("/")[0]
    frame["is_activated"], frame["is_manifested"] = frame["t_activation"].notna(), frame["t_manifest"].notna()
    frame["is_hazard"] = frame[["t_h1", "t_h3"]].notna().any(axis=1)
    frame["is_alert"] = frame["alerts"] != ""
    frame["reaction_time"] = [
        1.5 if row[0] == "vision_output/path_model" and row[8] else None for row in RUNS
    ]
    return frame


def test_each_count_is_of_its_runs(frame: pd.DataFrame) -> None:
    counts = dict(count_runs(frame))
    assert counts["speed, slower: hazards, and the first ones"] == "1 of 2 (H3 1)"
    assert counts["speed, faster: hazards, and the first ones"] == "0 of 0"
    assert counts["invisible vehicle in C4: hazards"] == "1 of 1"
    assert counts["path model, random, before 24 s: hazards"] == "1 of 1"
    assert counts["path model, random, later: hazards"] == "0 of 1"
    assert counts["path model: median time from alert to hazard"] == "1.50 s of 1"
    assert counts["camera's distance, both methods: manifested"] == "0 of 1"
    [unchanged] = [count for what, count in counts.items() if what.startswith("not manifested")]
    assert unchanged == "1 of 2"
    assert counts["camera frames: alerts"] == "1 of 2"
    assert counts["camera frames: scenarios and contexts with an activated fault"] == "1"
    assert counts["alerts: steer_saturated alone"] == "1 of 3"
    assert counts["hazards: without an alert before"] == "2 of 3"


def test_runs_without_any_activated_fault_have_counts(frame: pd.DataFrame) -> None:
    inactive = frame.assign(is_activated=False)
    assert {count for _, count in count_runs(inactive)} == {"0 of 0", "-", "0"}
