"""The lane detector as the paper's authors coded it, including the false lines that it accepts."""

import numpy as np
import pytest
from selfdrive.common.camera_model import CameraModel
from selfdrive.common.errors import ConfigError
from selfdrive.messages import CameraView
from selfdrive.sim.road_renderer import RoadRenderer
from selfdrive.visiond import authors_code_detector as coded
from selfdrive.visiond.authors_code_detector import AuthorsCodeDetector, edges_in_windows, lateral_position
from selfdrive.visiond.detector import LaneLines

CALTECH = CameraModel()


def seen(detector: AuthorsCodeDetector, picture: np.ndarray) -> LaneLines:
    """Return the lines detected in `picture`. The view's other fields are dummies."""
    return detector.detect(
        CameraView(left_lane_y=9.0, right_lane_y=9.0, path_y=9.0, bend=(), lead_d_rel=50.0, picture=picture)
    )


@pytest.fixture(scope="module")
def road() -> RoadRenderer:
    return RoadRenderer(CALTECH, "solid", 5, periods=3)


@pytest.mark.parametrize("offset", [0.0, 0.4, -0.4])
def test_lines_are_read_in_one_row(road: RoadRenderer, offset: float) -> None:
    """Each line is read at row 278, shifted 3 px towards the middle, and converted to metres by a fixed
    scale.
    """
    found = seen(AuthorsCodeDetector(CALTECH), road.render_grey(4.0, offset))
    for line, true, inward in zip(found[:2], road.true_lines(offset), (3, -3), strict=True):
        a, b = CALTECH.line_in_picture(*true)
        assert line.y == pytest.approx(lateral_position(a * 278 + b + inward), abs=0.05)
        assert (line.slope, line.prob) == (0.0, 1.0)
    assert found.path == (0.0, 0.0, 1.0, None)


def test_a_line_without_a_cluster_is_in_the_first_column(road: RoadRenderer) -> None:
    for half, expected in ((slice(320, None), (None, 8.03)), (slice(None, 320), (7.88, None))):
        picture = road.render_grey(4.0).copy()
        picture[:, half] = 97
        found = seen(AuthorsCodeDetector(CALTECH), picture)
        for line, y in zip(found[:2], expected, strict=True):
            assert line.prob == 1.0
            if y is not None:
                assert line.y == pytest.approx(y, abs=0.005)


def test_both_lines_can_be_missing(road: RoadRenderer, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(coded, "MIN_CLUSTER_POINTS", 10**6)
    found = seen(AuthorsCodeDetector(CALTECH), road.render_grey(4.0))
    assert [line.y for line in found[:2]] == pytest.approx([7.88, 8.03], abs=0.005)
    assert [line.prob for line in found[:2]] == [1.0, 1.0]


@pytest.mark.parametrize(("edges", "looked_at"), [(24, False), (25, True)])
def test_a_window_needs_25_edges(edges: int, looked_at: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    crests = np.zeros((np.prod(coded.WINDOW_COUNTS), 32, 32), bool)
    crests[40].reshape(-1)[:edges] = True
    monkeypatch.setattr(coded, "edges_in_windows", lambda part: crests)
    detector = AuthorsCodeDetector(CALTECH, threshold=-np.inf)
    points = detector._edge_points(np.zeros(coded.WINDOWS_PART_SIZE, np.uint8))
    assert len(points) == (edges if looked_at else 0)
    if looked_at:  # window 40 is the twelfth of the second row
        assert points.min(axis=0).tolist() == [235 + 16, 90 + 11 * 16]


@pytest.mark.parametrize(("points", "column"), [(29, 0), (30, 200)])
def test_a_cluster_needs_30_points(points: int, column: int) -> None:
    """A point is counted once for each window that found it."""
    left = np.column_stack((np.repeat(np.arange(270, 285), 2)[:points], np.full(points, 200)))
    right = np.column_stack((np.arange(265, 305), np.full(40, 440)))
    assert coded._columns_of_lines(np.concatenate((left, right))) == pytest.approx((column, 440))


def test_without_edges_the_lines_keep_their_positions(road: RoadRenderer) -> None:
    detector = AuthorsCodeDetector(CALTECH)
    before = seen(detector, road.render_grey(4.0, 0.3))
    assert seen(detector, np.full((480, 640), 97, np.uint8)) == before
    blind = AuthorsCodeDetector(CALTECH)
    assert seen(blind, np.zeros((480, 640), np.uint8)).left.y == 1.85


def test_the_detectors_only_memory_is_its_state(road: RoadRenderer) -> None:
    one, other = AuthorsCodeDetector(CALTECH), AuthorsCodeDetector(CALTECH)
    seen(one, road.render_grey(4.0, 0.3))
    other.state = one.state
    nothing = np.zeros((480, 640), np.uint8)
    assert seen(other, nothing) == seen(one, nothing)


def test_steepness_is_relative_to_the_window() -> None:
    random = np.random.default_rng(1)
    faint = random.integers(0, 10, coded.WINDOWS_PART_SIZE).astype(np.uint8)
    assert edges_in_windows(faint).any()
    assert np.array_equal(edges_in_windows(faint), edges_in_windows(10 * faint))


def test_edges_are_brightness_steps_between_rows() -> None:
    level, upright = np.zeros((2, *coded.WINDOWS_PART_SIZE), np.uint8)
    level[40:], upright[:, 40:] = 100, 100
    assert edges_in_windows(level).any()
    assert not edges_in_windows(upright).any()


def test_a_chain_of_pixels_joins_two_clusters() -> None:
    crowd = np.argwhere(np.ones((8, 8), bool))
    beyond = crowd + np.array([0, 38])
    chain = np.column_stack((np.full(30, 4), np.arange(8, 38)))
    labels = coded._link_pixels(np.concatenate((crowd, chain, beyond)), 1.5)
    assert len(set(labels)) == 1
    assert len(set(coded._link_pixels(np.concatenate((crowd, beyond)), 1.5))) == 2


def test_frames_of_another_size_are_refused() -> None:
    """The detector's pixel positions are fixed."""
    with pytest.raises(ConfigError, match=r"pictures of 1280 x 720.*expected 640 x 480"):
        AuthorsCodeDetector(
            CameraModel.from_view(width=1280, rows=720, horizon=238.0, focal=1000.0, height=1.5)
        )
