"""The rule that chooses a threshold of the detector as coded from real frames."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from selfdrive.common.camera_model import CameraModel
from selfdrive.sim.road_look import SOLID
from selfdrive.sim.road_renderer import RoadRenderer
from selfdrive.visiond.authors_code_detector import LINE_READ_ROW
from selfdrive.visiond_lab import choose_threshold
from selfdrive.visiond_lab.choose_threshold import choose, count_lines, first_departure, load_scenarios
from selfdrive.visiond_lab.evaluate_on_real_frames import LabelledFrame


@pytest.fixture
def scenarios() -> Path:
    return Path(__file__).parents[4] / "fault_library" / "scenarios"


@pytest.mark.parametrize(
    ("lines", "safe", "chosen"),
    [
        ({1.0: 5, 1.25: 6, 1.5: 6, 1.75: 6, 2.0: 4}, {1.0, 1.25, 1.5, 1.75, 2.0}, 1.5),  # the middle
        ({1.0: 5, 1.25: 6, 1.5: 6, 2.0: 4}, {1.0, 1.25, 1.5, 2.0}, 1.5),  # of two the upper
        ({1.0: 5, 1.25: 6, 1.5: 6, 2.0: 4}, {1.0, 1.25, 2.0}, 1.25),  # only safe ones
        ({1.0: 5, 1.25: 6, 2.0: 4}, {2.0}, 2.0),  # fewer lines if no better one is safe
        ({1.0: 5}, set(), None),
    ],
)
def test_the_middle_of_the_safe_thresholds_with_the_most_lines_is_chosen(
    lines: dict[float, int], safe: set[float], chosen: float | None
) -> None:
    assert choose(lines, safe.__contains__) == chosen


def test_lines_of_a_frame_are_counted_by_side() -> None:
    """A threshold that no window reaches finds none; a wrong label is not found."""
    road = RoadRenderer(CameraModel(), SOLID, 1, periods=2)
    grey = road.render_grey(3.0, 0.0)
    left, right = (
        a * LINE_READ_ROW + b for a, b in (road.model.line_in_picture(*x) for x in road.true_lines(0.0))
    )
    frame = LabelledFrame(
        key="f",
        colour=np.dstack([grey] * 3),
        model=road.model,
        left_column=left,
        right_column=right,
        slopes=(0.0, 0.0),
    )
    wrong = replace(frame, left_column=left - 90.0)
    assert (count_lines(4.0, [frame]), count_lines(50.0, [frame])) == (2, 0)
    assert count_lines(4.0, [frame, wrong]) == 3


def test_all_scenarios_run_with_and_without_a_lead_on_both_plants(scenarios: Path) -> None:
    loaded = load_scenarios(scenarios)
    assert len({(s.name, s.plant, s.lead is None) for s in loaded}) == len(loaded) == 20


def test_a_car_that_sees_no_mark_leaves_its_lane(scenarios: Path, tmp_path: Path) -> None:
    """The first of the scenarios is reported, with the time."""
    two = load_scenarios(scenarios)[-2:]
    scenario, t = first_departure(0.0, two, tmp_path) or (None, 0.0)
    assert scenario is two[0] and 1.3 < t < 30.0


def test_the_command_prints_the_chosen_threshold(
    monkeypatch: pytest.MonkeyPatch, scenarios: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(choose_threshold, "TRIED_THRESHOLDS", [1.0, 2.0, 3.0])
    monkeypatch.setattr(choose_threshold, "load_labelled_frames", lambda *_: [None] * 6)
    monkeypatch.setattr(choose_threshold, "count_lines", lambda threshold, frames: 12 - int(threshold > 2.0))
    departed = lambda threshold, scenarios, cache: (scenarios[1], 7.5) if threshold == 1.0 else None  # noqa: E731
    monkeypatch.setattr(choose_threshold, "first_departure", departed)
    assert choose_threshold.main([str(tmp_path), str(tmp_path / "truth.json"), str(scenarios)]) == 0
    assert capsys.readouterr().out.splitlines() == [
        " 1.00: 12 of 12 lines found",
        " 2.00: 12 of 12 lines found",
        " 3.00: 11 of 12 lines found",
        " 1.00: the fault-free run of S1 without lead on the standard plant leaves its lane after 7.50 s",
        " 2.00: no fault-free run leaves its lane",
        "2.00",
    ]


def test_frames_without_a_truth_file_are_refused(
    scenarios: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert choose_threshold.main([str(tmp_path), str(tmp_path / "truth.json"), str(scenarios)]) == 2
    assert "truth.json" in capsys.readouterr().err
