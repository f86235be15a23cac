"""Detectors with arithmetic in C return the results of the Python code, to the last bit."""

from dataclasses import replace
from math import sin

import cv2
import numpy as np
import pytest
from selfdrive.common import compiled
from selfdrive.common.camera_model import CameraModel
from selfdrive.messages import CameraView
from selfdrive.sim import compile_helpers
from selfdrive.sim.effects.effect import Moment
from selfdrive.sim.effects.levels import AMOUNTS_BY_EFFECT
from selfdrive.sim.road_renderer import RoadRenderer
from selfdrive.visiond import compiled_robust, compiled_view, compiled_windows
from selfdrive.visiond.authors_code_detector import AuthorsCodeDetector
from selfdrive.visiond.band_filter import MOST_POINTS, SKIPPED_BORDER_COLUMNS
from selfdrive.visiond.compiled_authors_code import CompiledAuthorsCodeDetector, build_authors_code_detector
from selfdrive.visiond.compiled_paper import CompiledPaperDetector, build_paper_detector
from selfdrive.visiond.compiled_robust import C_SOURCES, CompiledVote, build_robust_detector
from selfdrive.visiond.compiled_view import CompiledRoadView
from selfdrive.visiond.compiled_windows import MarkWindowFinder
from selfdrive.visiond.hog import WINDOW_FEATURES, Hog, detection_windows
from selfdrive.visiond.lane_net import FEATURE_STEPS, PAPER_NET, LaneNet
from selfdrive.visiond.paper_detector import PaperDetector
from selfdrive.visiond.road_view import RoadView
from selfdrive.visiond.robust_detector import RobustDetector
from selfdrive.visiond.voting import ExpectedPose, find_pose

pytestmark = pytest.mark.skipif(not compile_helpers.compiler_command(), reason="there is no C compiler")
MODEL = CameraModel()
SMALL = CameraModel.from_view(width=512, rows=400, horizon=150.0, focal=400.0, height=1.3)
VOTING = C_SOURCES[1]
DETECTORS = {
    "paper": (PaperDetector, build_paper_detector, CompiledPaperDetector),
    "as_coded": (AuthorsCodeDetector, build_authors_code_detector, CompiledAuthorsCodeDetector),
    "robust": (RobustDetector, build_robust_detector, RobustDetector),
}


@pytest.fixture(
    scope="module",
    params=["", pytest.param(" -DPLAIN", marks=pytest.mark.slow)],
    ids=["vectors", "plain"],
)
def helpers(request, tmp_path_factory, all_compiled):
    """A folder with all libraries, compiled with or without vector instructions."""
    if not request.param:
        return all_compiled
    folder = tmp_path_factory.mktemp("compiled")
    with pytest.MonkeyPatch.context() as patch:
        words = " ".join(compile_helpers.compiler_command())
        patch.setenv("CC", words + request.param)
        list(compile_helpers.compile_helpers(folder))
    return folder


@pytest.fixture(autouse=True)
def _found(helpers):
    compiled.use_libraries_in(helpers)
    yield
    compiled.use_libraries_in(None)


@pytest.fixture(scope="module")
def pictures():
    """Images of a road from many poses, clean, with every effect and with noise, and images of pure noise and
    of a single tone."""
    chance, found = np.random.default_rng(3), []
    roads = [RoadRenderer(MODEL, marks, 1, periods=3) for marks in ("solid", "dashed")]
    changes = [None] * 8 + [
        kind(amount, 1, MODEL) for kind, each in AMOUNTS_BY_EFFECT.items() for amount in (each[0], each[-1])
    ]
    for k, effect in enumerate(changes):
        picture = roads[k % 2].render_grey(9.0 * k, 1.5 * sin(k), 0.03 * sin(1.7 * k))
        if effect:
            picture = effect.apply(picture, Moment(2.0 + k, 9.0 * k, 26.0))
        found.append(picture)
    clean = roads[0].render_grey(0.0)
    found += [
        np.clip(clean + chance.normal(0.0, size, clean.shape), 0, 255).astype(np.uint8)
        for size in (5, 15, 60)
    ]
    found += [chance.integers(low, high, clean.shape).astype(np.uint8) for low, high in ((0, 256), (90, 96))]
    return [*found, np.zeros_like(clean), np.full_like(clean, 255), clean // 8, 255 - clean]


def view(picture) -> CameraView:
    return CameraView(
        left_lane_y=9.0, right_lane_y=9.0, path_y=9.0, bend=(), lead_d_rel=50.0, picture=picture
    )


@pytest.mark.parametrize("name", DETECTORS)
def test_lines_have_the_same_bits(name, pictures):
    plain, build, kind = DETECTORS[name]
    slow, fast = plain(MODEL), build(MODEL)
    assert type(fast) is kind and fast.calculated_by != slow.calculated_by
    for picture in pictures:
        assert repr(fast.detect(view(picture))) == repr(slow.detect(view(picture)))
        assert repr(fast.state) == repr(slow.state)


@pytest.mark.parametrize(
    "model",
    [
        SMALL,
        replace(MODEL, width=320, rows=240, fx=154.7, fy=172.1, cx=159, cy=128),
        replace(MODEL, width=160, cx=80.0, rows=960, cy=513.0, fy=700.0),
    ],
    ids=["wide", "small", "narrow"],
)
def test_lines_of_another_camera_have_the_same_bits(model):
    slow, fast = PaperDetector(model), build_paper_detector(model)
    road = RoadRenderer(model, "dashed", 2, periods=2)
    for k in range(8):
        picture = cv2.add(road.render_grey(7.0 * k, 0.8 * sin(k), 0.02 * sin(3 * k)), k)
        assert repr(fast.detect(view(picture))) == repr(slow.detect(view(picture)))


@pytest.mark.parametrize("name", DETECTORS)
def test_impossible_images_give_the_same_lines_or_the_same_error(name, pictures):
    """A fault can give an image another type, memory order or size."""
    plain, build, _ = DETECTORS[name]
    slow, fast = plain(MODEL), build(MODEL)
    odd = [
        np.asfortranarray(pictures[0]),
        pictures[0] * np.float32(0.7),
        pictures[0][:300],
        pictures[0][:, ::-1],
    ]
    odd += [
        pictures[0].astype(np.int16),
        pictures[0][:0],
        np.dstack([pictures[0]] * 3),
        pictures[0].astype(float),
    ]
    for picture in odd:
        assert _outcome(fast, picture) == _outcome(slow, picture)


def _outcome(detector, picture) -> str:
    try:
        return repr(detector.detect(view(picture)))
    except (ValueError, cv2.error, IndexError, TypeError) as error:
        return repr(type(error))


@pytest.mark.parametrize(
    "width, rows, focal", [(640, 480, 400), (512, 400, 600), (256, 200, 200), (637, 403, 500)]
)
def test_maps_of_any_camera_are_the_same(width, rows, focal):
    model = CameraModel.from_view(width=width, rows=rows, horizon=0.3 * rows, focal=focal, height=1.3)
    slow, fast = RoadView(model), CompiledRoadView(model, compiled.library(compiled_view.C_SOURCE))
    for seed in range(5):
        picture = np.random.default_rng(seed).integers(0, 256, (rows, width), np.uint8)
        assert np.array_equal(fast.map_picture(picture), slow.map_picture(picture))


@pytest.mark.parametrize("seed", range(40))
def test_votes_are_the_same(seed):
    chance = np.random.default_rng(seed)
    view = RoadView(MODEL)
    road = chance.integers(0, 2, (len(view.drop), len(view.y)), np.uint8)
    road[chance.random(len(view.drop)) < chance.choice([0.0, 0.5, 1.0])] = 7
    numbers = len(view.drop) * (len(view.y) - 2 * SKIPPED_BORDER_COLUMNS)
    count = chance.choice([seed % 10, chance.integers(0, 900), MOST_POINTS])
    at = np.sort(chance.choice(numbers, count, replace=False))
    weight = chance.uniform(0.0, 1.0, len(at)).astype(np.float32)
    fast = CompiledVote(compiled.library(VOTING), view)
    first, then = ExpectedPose(), ExpectedPose((0.3, 0.19), (3.5, 0.02), (-9.1, 11.14), (1.7, 1.5))
    wider, anywhere = then._replace(width=(7.9, 0.2)), first._replace(meeting_left=(0.0, 104.0))
    for belief in (first, then, then._replace(meeting_left=(2.0, 41.0), width=(3.3, 0.2)), wider, anywhere):
        found = [_voted(each, view, road, at, weight, belief) for each in (fast, find_pose)]
        assert found[0] == found[1]


def _voted(choose, *given) -> str:
    try:
        return repr(choose(*given))
    except ValueError as error:
        return repr(type(error))


@pytest.mark.parametrize("name", ["RoadView", "find_crests", "find_pose"])
def test_the_library_is_not_used_if_python_computes_other_bits(name, monkeypatch):
    here = RoadView.map_picture if name == "RoadView" else getattr(compiled_robust, name)

    def otherwise(*given):
        first, *others = here(*given)
        return [first + 1, *others]

    checks = (
        compiled_robust.has_identical_maps,
        compiled_robust.has_identical_crests,
        compiled_robust.has_identical_votes,
    )
    monkeypatch.setattr(
        *((RoadView, "map_picture") if name == "RoadView" else (compiled_robust, name)), otherwise
    )
    for check in checks:
        check.cache_clear()
    found = build_robust_detector(MODEL)
    monkeypatch.undo()
    for check in checks:
        check.cache_clear()
    assert not found.calculated_by and build_robust_detector(MODEL).calculated_by


def test_features_and_marked_windows_are_the_same(helpers, pictures):
    size = 112, 480
    hog, net = Hog(*size), LaneNet.load(PAPER_NET)
    for threshold in (0.0, 4.0, -2.5):
        fast = MarkWindowFinder(net, size, threshold, compiled.library(compiled_windows.C_SOURCE))
        for picture in pictures[::3]:
            part = np.ascontiguousarray(picture[200:312, 80:560])
            found = hog.blocks(part)
            looked_at = np.random.default_rng(int(part.sum())).random((6, 29)) < 0.4
            marked = looked_at.copy()
            assert fast.clear_windows_without_mark(part.ctypes.data, marked.ctypes.data)
            row, column = looked_at.nonzero()
            above = (
                net.log_odds(detection_windows(found)[row, column].reshape(-1, WINDOW_FEATURES)) > threshold
            )
            assert (marked[row, column] == above).all() and not marked[~looked_at].any()
            steps = np.rint(detection_windows(found) * np.float32(FEATURE_STEPS))
            assert (detection_windows(fast.blocks)[looked_at] == steps[looked_at]).all()


def test_a_score_too_close_to_the_threshold_is_left_to_python(pictures):
    """The C code reports a score close to the threshold, and the detector asks the net."""
    part = np.ascontiguousarray(pictures[0][200:232, 280:312])
    net = LaneNet.load(PAPER_NET)
    score = float(net.log_odds(detection_windows(Hog(32, 32).blocks(part)).reshape(1, WINDOW_FEATURES))[0])
    library = compiled.library(compiled_windows.C_SOURCE)
    for threshold, decided in ((score, False), (score - 1e-8, True), (score + 1e-8, True)):
        window = np.ones(1, bool)
        assert (
            MarkWindowFinder(net, (32, 32), threshold, library).clear_windows_without_mark(
                part.ctypes.data, window.ctypes.data
            )
            is decided
        )
        assert not decided or window[0] == (score > threshold)
