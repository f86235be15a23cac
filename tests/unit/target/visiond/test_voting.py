"""The fit of two parallel lines to points."""

import numpy as np
import pytest
from selfdrive.common.camera_model import CameraModel
from selfdrive.visiond.band_filter import MarkPoints
from selfdrive.visiond.road_view import CELL_WIDTH, RoadView
from selfdrive.visiond.voting import ExpectedPose, LanePose, VotingPoints, elect_candidate, fit_pose

VIEW = RoadView(CameraModel())


def points_on(pose: LanePose, lines: str = "LR", chance: int = 0, seed: int = 0) -> MarkPoints:
    rng = np.random.default_rng(seed)
    rows, columns = [], []
    for side, y in (("L", pose.y_left), ("R", pose.y_right)):
        px = pose.meeting_left + y * VIEW.scale / VIEW.drop * (VIEW.drop + pose.meeting_dip)
        column = np.round((VIEW.y[0] - px / VIEW.scale) / CELL_WIDTH)
        shown = (column >= 0) & (column < len(VIEW.y)) & (side in lines)
        rows.append(np.flatnonzero(shown))
        columns.append(column[shown].astype(int))
    rows.append(rng.integers(0, len(VIEW.drop), chance))
    columns.append(rng.integers(0, len(VIEW.y), chance))
    row = np.concatenate(rows)
    return MarkPoints(row, np.concatenate(columns), np.ones(len(row), np.float32))


def solve(points: MarkPoints, belief: ExpectedPose) -> LanePose:
    voters = VotingPoints(VIEW, points, float(VIEW.share.sum()))
    return fit_pose(elect_candidate(voters, belief), voters, belief)


@pytest.mark.parametrize("middle", [-0.8, 0.1, 0.7])
@pytest.mark.parametrize("left", [-22.0, 3.0, 30.0])
@pytest.mark.parametrize("dip", [-7.0, 0.0, 9.0])
@pytest.mark.parametrize("width", [3.2, 3.7, 4.2])
def test_lines_are_found_at_any_pose_and_width(middle, left, dip, width):
    """About a third of the points are random."""
    true = LanePose(left, dip, middle + 0.5 * width, middle - 0.5 * width)
    found = solve(points_on(true, chance=120), ExpectedPose())
    assert found.y_left == pytest.approx(true.y_left, abs=0.04)
    assert found.y_right == pytest.approx(true.y_right, abs=0.04)
    assert found.meeting_left == pytest.approx(left, abs=2.0)
    assert min(found.prob_left, found.prob_right) > 0.5


@pytest.mark.parametrize(("lines", "missing"), [("L", "y_right"), ("R", "y_left")])
def test_an_unseen_line_is_placed_a_lane_width_away(lines, missing):
    true = LanePose(5.0, 0.0, 1.6, -1.8)
    found = solve(points_on(true, lines), ExpectedPose(width=(3.4, 0.1)))
    assert getattr(found, missing) == pytest.approx(getattr(true, missing), abs=0.1)
    assert getattr(found, missing.replace("y_", "prob_")) < 0.1


def test_without_points_the_belief_is_unchanged():
    found = solve(
        points_on(LanePose(0.0, 0.0, 1.85, -1.85), lines=""),
        ExpectedPose(middle=(0.3, 0.1), width=(3.6, 0.1)),
    )
    assert found.middle == pytest.approx(0.3, abs=1e-3) and found.width == pytest.approx(3.6, abs=1e-3)
    assert found.prob_left == found.prob_right == 0.0


@pytest.mark.parametrize("seed", range(5))
def test_the_belief_finds_the_lines_among_many_random_points(seed):
    true = LanePose(4.0, 0.0, 1.95, -1.75)
    points = points_on(true, chance=1500, seed=seed)
    belief = ExpectedPose(
        middle=(0.15, 0.1), width=(3.7, 0.1), meeting_left=(0.0, 4.0), meeting_dip=(0.0, 1.5)
    )
    found = solve(points, belief)
    assert found.y_left == pytest.approx(true.y_left, abs=0.05)
    assert found.y_right == pytest.approx(true.y_right, abs=0.05)


def test_random_points_alone_give_no_confident_lines():
    found = solve(points_on(LanePose(0.0, 0.0, 1.85, -1.85), lines="", chance=1500), ExpectedPose())
    assert max(found.prob_left, found.prob_right) < 0.6
