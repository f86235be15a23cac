"""The paper's lane detector on rendered roads."""

from dataclasses import replace

import numpy as np
import pytest
from selfdrive.common.camera_model import CameraModel
from selfdrive.messages import CameraView
from selfdrive.sim.road_look import RoadLook, standard_look
from selfdrive.sim.road_renderer import RoadRenderer
from selfdrive.visiond.dbscan import dbscan
from selfdrive.visiond.lane_net import PAPER_NET, LaneNet
from selfdrive.visiond.mark_edges import find_steep_edges, tile_numbers, tiles_with_mark, windows_on_tiles
from selfdrive.visiond.paper_detector import (
    CLUSTER_REACH,
    MIN_CLUSTER_EDGES,
    MIN_MARKED_WINDOWS,
    PaperDetector,
)
from selfdrive.visiond.road_region import RoadRegion
from sklearn.cluster import DBSCAN
from threadpoolctl import threadpool_limits

CALTECH = CameraModel()
LOW = CameraModel.from_view(width=640, rows=480, horizon=200.0, focal=579.0, height=1.21)
HIGH = CameraModel.from_view(width=640, rows=480, horizon=200.0, focal=500.0, height=1.68)
POSES = ((0.0, 0.0), (0.6, 0.0), (-0.6, 0.0), (0.2, -0.03), (-0.3, 0.04))  # offset in m, heading in rad


def view(picture: np.ndarray) -> CameraView:
    return CameraView(
        left_lane_y=9.0, right_lane_y=9.0, path_y=9.0, bend=(), lead_d_rel=50.0, picture=picture
    )


@pytest.fixture(scope="module", params=["caltech", "low", "high"])
def road(request) -> RoadRenderer:
    """The standard road in front of three cameras."""
    return RoadRenderer({"caltech": CALTECH, "low": LOW, "high": HIGH}[request.param], "solid", 5, periods=3)


@pytest.fixture(scope="module")
def faded() -> RoadRenderer:
    """A road with an invisible right line and no adjacent lane."""
    look = standard_look()
    look = replace(look, right=replace(look.right, fade=1.0), far_left=None, far_right=None)
    return RoadRenderer(CALTECH, look, 5, periods=3)


@pytest.mark.parametrize(("offset", "heading"), POSES)
def test_both_lines_are_found_at_their_true_place(road, offset, heading):
    found = PaperDetector(road.model).detect(view(road.render_grey(4.0, offset, heading)))
    for line, (y, slope) in zip(found[:2], road.true_lines(offset, heading), strict=True):
        assert line.prob > 0.5
        assert line.y == pytest.approx(y, abs=0.06)
        assert line.slope == pytest.approx(slope, abs=0.01)
    assert found.path.y == pytest.approx(0.5 * (found.left.y + found.right.y))


def test_earlier_frames_do_not_change_the_result():
    road = RoadRenderer(CALTECH, "dashed", 3, periods=3)
    detector, picture = PaperDetector(CALTECH), road.render_grey(7.0, 0.3)
    expected = PaperDetector(CALTECH).detect(view(picture))
    for offset in (-1.0, 0.0, 1.0):
        detector.detect(view(road.render_grey(2.0, offset)))
    assert detector.detect(view(picture)) == expected


def test_read_only_images_are_accepted_and_not_changed():
    """Processes share read-only images."""
    picture = RoadRenderer(CALTECH, "solid", 1, periods=2).render_grey(0.0)
    before = picture.copy()
    picture.flags.writeable = False
    assert PaperDetector(CALTECH).detect(view(picture)).left.prob > 0.5
    assert np.array_equal(picture, before)


@pytest.mark.parametrize("level", [0, 97, 255])
def test_an_even_image_has_no_lines(level):
    found = PaperDetector(CALTECH).detect(view(np.full((480, 640), level, np.uint8)))
    assert [(line.y, line.prob) for line in found] == [(1.85, 0.0), (-1.85, 0.0), (0.0, 0.0)]


def test_with_one_line_the_path_is_half_a_lane_beside_it(faded):
    found = PaperDetector(CALTECH).detect(view(faded.render_grey(5.0, 0.4)))
    assert found.left.prob > 0.5
    assert found.right.prob == 0.0
    assert found.path.y == pytest.approx(1.45 - 1.85, abs=0.06)


def test_the_middle_of_the_car_divides_left_from_right(faded):
    found = PaperDetector(CALTECH).detect(view(faded.render_grey(5.0, 2.6)))
    assert found.right.y == pytest.approx(1.85 - 2.6, abs=0.08)


def test_shadows_and_seams_beside_the_middle_are_not_lines():
    look = RoadLook(
        shadow_share=0.35,
        shadow_depth=0.6,
        seams_per_100_m=8.0,
        cracks_per_100_m=12.0,
        patches_per_100_m=6.0,
        joint_tone=-50.0,
    )
    road = RoadRenderer(CALTECH, look, 11, periods=8)
    detector = PaperDetector(CALTECH)
    for position in np.arange(0.0, 90.0, 6.0):
        found = detector.detect(view(road.render_grey(position)))
        assert found.left.y == pytest.approx(1.85, abs=0.3)
        assert found.right.y == pytest.approx(-1.85, abs=0.3)


def test_real_edges_get_the_clusters_of_scikit_learn():
    region = RoadRegion(CALTECH)
    for look in (RoadLook(), RoadLook(shadow_share=0.5, shadow_depth=0.6, cracks_per_100_m=20.0, grain=9.0)):
        part = RoadRenderer(CALTECH, look, 2, periods=3).render_grey(3.0)[region.part]
        at, _ = find_steep_edges(np.ascontiguousarray(part))
        pixels = np.stack(np.unravel_index(at, part.shape), axis=1)
        expected = DBSCAN(eps=CLUSTER_REACH, min_samples=MIN_CLUSTER_EDGES, metric="chebyshev").fit_predict(
            pixels
        )
        assert expected.max() > 0
        assert np.array_equal(dbscan(at, part.shape, CLUSTER_REACH, MIN_CLUSTER_EDGES), expected)


def test_scores_do_not_depend_on_the_number_of_threads():
    features = np.random.default_rng(0).random((192, 1764), dtype=np.float32)
    net = LaneNet.load(PAPER_NET)
    with threadpool_limits(1):
        alone = net.log_odds(features)
    with threadpool_limits(2):
        assert np.array_equal(net.log_odds(features), alone)


def test_a_tile_needs_enough_marked_windows():
    marked = np.zeros((3, 4), bool)
    marked[1, 2] = True
    assert tiles_with_mark(marked, 1).sum() == 4
    assert tiles_with_mark(marked, MIN_MARKED_WINDOWS).sum() == 0


def test_the_windows_on_a_tile_are_those_that_can_mark_it():
    tiles = np.zeros((4, 5), bool)
    tiles.ravel()[tile_numbers(64, 80)[40 * 80 + 50]] = True  # the pixel in row 40, column 50
    assert np.argwhere(tiles).tolist() == [[2, 3]]
    assert np.argwhere(windows_on_tiles(tiles)).tolist() == [[1, 2], [1, 3], [2, 2], [2, 3]]
    assert tiles_with_mark(windows_on_tiles(tiles), 4)[2, 3]


def test_a_windows_score_does_not_depend_on_other_windows():
    features = np.random.default_rng(1).random((64, 1764), dtype=np.float32)
    net = LaneNet.load(PAPER_NET)
    scores = net.log_odds(features)
    other = np.random.default_rng(2).permutation(64)
    assert np.array_equal(net.log_odds(features[other]), scores[other])
