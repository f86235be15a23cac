"""The geometric lane detector on rendered roads."""

from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from selfdrive.common.camera_model import CameraModel
from selfdrive.messages import CameraView
from selfdrive.sim.road_look import LinePaint, OtherCar, standard_look
from selfdrive.sim.road_renderer import RoadRenderer
from selfdrive.visiond.detector import LaneLines
from selfdrive.visiond.robust_detector import MOST_PICTURES_WITHOUT_LINES, RobustDetector

CAMERAS = {
    "steep": CameraModel(),
    "flat": CameraModel.from_view(width=640, rows=480, horizon=200, focal=579, height=1.21),
    "large": CameraModel.from_view(width=1280, rows=720, horizon=330, focal=1000, height=1.5),
}
STEP = 1.342  # m between frames


@cache
def renderer(camera: str = "steep", marks: str = "solid") -> RoadRenderer:
    return RoadRenderer(CAMERAS[camera], marks, 5, periods=4)


def see(detector: RobustDetector, picture: np.ndarray) -> LaneLines:
    nan = float("nan")
    return detector.detect(
        CameraView(left_lane_y=nan, right_lane_y=nan, path_y=nan, bend=(), lead_d_rel=nan, picture=picture)
    )


def errors(lines: LaneLines, truth: tuple) -> list[float]:
    return [abs(line.y - y) for line, (y, _) in zip((lines.left, lines.right), truth, strict=True)]


@pytest.mark.parametrize("camera", CAMERAS)
@pytest.mark.parametrize("marks", ["solid", "dashed"])
@pytest.mark.parametrize(("offset", "heading"), [(0.0, 0.0), (0.6, -0.03), (-0.7, 0.04)])
def test_one_frame_is_enough_to_find_both_lines(camera, marks, offset, heading):
    road = renderer(camera, marks)
    truth = road.true_lines(offset, heading)
    lines = see(RobustDetector(road.model), road.render_grey(3.0, offset, heading))
    assert max(errors(lines, truth)) < 0.06
    for line, (_, slope) in zip((lines.left, lines.right), truth, strict=True):
        assert line.slope == pytest.approx(slope, abs=0.01)
        assert line.prob > 0.5
    assert lines.path.y == pytest.approx(0.5 * (lines.left.y + lines.right.y))


def test_distractors_do_not_hide_the_lines():
    """The road is made of concrete and has seams, joints, shadows, faint paint, a double line, a kerb and
    cars."""
    look = replace(
        standard_look("dashed"),
        asphalt_tone=150.0,
        left=LinePaint(tone=176.0, double=True, yellow=True, width=0.1),
        right=LinePaint(tone=200.0, dashed=True, wear=0.2),
        seams_per_100_m=2.0,
        joint_spacing=5.0,
        shadow_share=0.3,
        kerb_tone=200.0,
        cars=(OtherCar(x=14.0, y=3.8, tone=220.0), OtherCar(x=25.0, y=0.2, tone=30.0)),
    )
    road = RoadRenderer(CAMERAS["flat"], look, 8, periods=4)
    for position in (0.0, 4.0, 9.0):
        lines = see(RobustDetector(road.model), road.render_grey(position, 0.2, 0.01))
        assert max(errors(lines, road.true_lines(0.2, 0.01))) < 0.12


@pytest.mark.parametrize("tone", [0, 128, 255])
def test_an_image_of_one_tone_has_no_lines(tone):
    model = CAMERAS["steep"]
    lines = see(RobustDetector(model), np.full((model.rows, model.width), tone, np.uint8))
    assert (lines.left.prob, lines.right.prob, lines.path.prob) == (0.0, 0.0, 0.0)
    assert (lines.left.y, lines.right.y) == (1.85, -1.85)


def test_lines_that_disappear_are_held_with_falling_probability():
    road = renderer()
    detector = RobustDetector(road.model)
    before = see(detector, road.render_grey(0.0, 0.4, 0.02))
    black = np.zeros((road.model.rows, road.model.width), np.uint8)
    held = [see(detector, black) for _ in range(MOST_PICTURES_WITHOUT_LINES + 1)]
    probs = [before.left.prob] + [lines.left.prob for lines in held]
    assert all(later < earlier for earlier, later in pairwise(probs))
    for lines in held[:-1]:
        assert (lines.left.y, lines.right.y) == (before.left.y, before.right.y)
    assert held[-1].left.prob == 0.0 == held[-1].right.prob
    again = see(detector, road.render_grey(1.0, -0.5, 0.0))
    assert max(errors(again, road.true_lines(-0.5, 0.0))) < 0.06


@pytest.mark.parametrize("side", ["left", "right"])
def test_one_line_gives_the_position_of_the_other(side):
    road = renderer()
    detector = RobustDetector(road.model)
    see(detector, road.render_grey(0.0))
    half = road.model.width // 2
    covered = slice(0, half) if side == "left" else slice(half, None)
    probs = []
    for i in range(1, 20):
        offset = 0.02 * i
        picture = road.render_grey(STEP * i, offset)
        picture[:, covered] = 60
        lines = see(detector, picture)
        probs.append(getattr(lines, side).prob)
        assert max(errors(lines, road.true_lines(offset))) < 0.1
        assert lines.path.prob > 0.0
    assert probs[-1] < 0.3 * probs[0]


def test_lines_are_followed_through_rain():
    """The rain has ten thousand streaks, and the road has dashes."""
    from types import SimpleNamespace

    from selfdrive.sim.effects import PaperRain

    road = renderer(marks="dashed")
    detector, rain = RobustDetector(road.model), PaperRain(10, 1, road.model)
    for i in range(40):
        scene = SimpleNamespace(t=0.05 * i, position=STEP * i, v_ego=26.8)
        offset = 0.3 * np.sin(0.1 * i)
        picture = road.render_grey(STEP * i, offset)
        lines = see(detector, rain.apply(picture, scene) if i > 3 else picture)
        assert max(errors(lines, road.true_lines(offset))) < 0.2


def test_after_crossing_a_line_the_next_lane_is_found():
    road = renderer()
    detector = RobustDetector(road.model)
    for i in range(75):
        offset = 0.05 * i  # ends one lane further left
        lines = see(detector, road.render_grey(STEP * i, offset, 0.01))
        known = offset if offset < 1.85 else offset - 3.7 if offset > 2.4 else None
        if known is not None:
            assert max(errors(lines, road.true_lines(known, 0.01))) < 0.1


def test_the_same_frames_give_the_same_lines():
    road = renderer()
    first, second, other = (RobustDetector(road.model) for _ in range(3))
    noise = np.random.default_rng(2)
    for i in range(6):
        picture = road.render_grey(STEP * i, 0.1 * i)
        picture = (picture + noise.integers(0, 60, picture.shape)).clip(0, 255).astype(np.uint8)
        picture.flags.writeable = False
        one = see(first, picture)
        see(other, road.render_grey(0.0, -0.5))
        assert see(second, picture.copy()) == one
