"""Rendered roads: lines at their true place, no flicker far away, equal bytes for equal seeds."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from selfdrive.common.camera_model import CameraModel
from selfdrive.sim.lead_picture import CAMERA_TO_BUMPER
from selfdrive.sim.road_look import DASH_LENGTH, DASH_PERIOD, LinePaint, OtherCar, RoadLook, standard_look
from selfdrive.sim.road_renderer import RoadRenderer, first_road_row

CALTECH = CameraModel()
UDACITY = CameraModel.from_view(width=640, rows=480, horizon=200.0, focal=600.0, height=1.22)
FRESH = LinePaint(wear=0.0)
BARE = RoadLook(
    left=FRESH,
    right=FRESH,
    far_left=None,
    far_right=None,
    grain=0.0,
    mottle=0.0,
    wheel_track_darkening=0.0,
    patches_per_100_m=0.0,
    cracks_per_100_m=0.0,
    shadow_share=0.0,
)


def finer(model, times):
    return replace(
        model,
        width=model.width * times,
        rows=model.rows * times,
        fx=model.fx * times,
        fy=model.fy * times,
        cx=(model.cx + 0.5) * times - 0.5,
        cy=(model.cy + 0.5) * times - 0.5,
    )


@pytest.fixture(scope="module")
def standard():
    return RoadRenderer(CALTECH, "dashed", 3, periods=2)


@pytest.mark.parametrize("model", [CALTECH, UDACITY])
@pytest.mark.parametrize(("offset", "heading"), [(0.0, 0.0), (0.4, 0.01), (-0.6, -0.03)])
def test_lines_are_at_their_true_place(model, offset, heading):
    renderer = RoadRenderer(model, BARE, 0, periods=1)
    picture = renderer.render_grey(5.0, offset, heading).astype(float) - BARE.asphalt_tone
    errors = []
    for line in renderer.true_lines(offset, heading):
        a, b = model.line_in_picture(*line)
        for row in range(int(model.horizon) + 8, model.rows):
            half = 0.2 / model.metres_per_pixel(row) + 3.0
            first, last = int(a * row + b - half), int(a * row + b + half) + 2
            if first >= 0 and last <= model.width:
                light = picture[row, first:last]
                errors.append(light @ np.arange(first, last) / light.sum() - (a * row + b))
    assert len(errors) > 300
    assert np.abs(errors).max() < 0.2
    assert np.std(errors) < 0.05
    assert abs(np.mean(errors)) < 0.01


def test_lines_have_their_true_width_at_any_distance():
    renderer = RoadRenderer(CALTECH, BARE, 0, periods=1)
    contrast = renderer.render_grey(0.0).astype(float) - BARE.asphalt_tone
    a, b = CALTECH.line_in_picture(*renderer.true_lines()[0])
    for row in [round(CALTECH.row(x)) for x in (3.0, 10.0, 30.0, 60.0, 120.0)]:
        scale = CALTECH.metres_per_pixel(row)
        half = 0.2 / scale + 3.0
        light = contrast[row, int(a * row + b - half) : int(a * row + b + half) + 2].sum()
        assert light * scale / (218.0 - BARE.asphalt_tone) == pytest.approx(0.12, rel=0.12)


@pytest.mark.parametrize("heading", [0.0, 0.02])
def test_the_far_field_is_anti_aliased(heading):
    look = replace(BARE, right=replace(FRESH, dashed=True))
    coarse = RoadRenderer(CALTECH, look, 0, periods=1).render_grey(5.0, 0.3, heading).astype(np.float32)
    fine = (
        RoadRenderer(finer(CALTECH, 4), look, 0, periods=1).render_grey(5.0, 0.3, heading).astype(np.float32)
    )
    averaged = cv2.resize(fine, (CALTECH.width, CALTECH.rows), interpolation=cv2.INTER_AREA)
    top = first_road_row(CALTECH) + 1
    for first, last in ((top, top + 15), (top + 15, top + 60), (top + 60, CALTECH.rows)):
        difference = (coarse - averaged)[first:last]
        assert np.sqrt((difference**2).mean()) < 2.0


def test_far_dashes_do_not_flicker():
    renderer = RoadRenderer(CALTECH, replace(BARE, right=replace(FRESH, dashed=True)), 0, periods=1)
    last = int(CALTECH.row(150.0))
    pictures = np.stack([renderer.render_grey(1.342 * k) for k in range(9)]).astype(int)
    far = pictures[:, first_road_row(CALTECH) : last]
    assert np.ptp(far, axis=0).max() <= 10


def test_dashes_have_the_dimensions_of_us_roads():
    renderer = RoadRenderer(CALTECH, replace(BARE, right=replace(FRESH, dashed=True)), 0, periods=1)
    row = CALTECH.rows - 1
    x = CALTECH.distance(row)
    column = round(CALTECH.column(x, -1.85))
    positions = np.arange(0.0, 2 * DASH_PERIOD, 0.05)
    painted = np.array([renderer.render_grey(position)[row, column] > 160 for position in positions])
    expected = np.mod(positions + x, DASH_PERIOD) < DASH_LENGTH
    assert np.mean(painted != expected) < 0.015


def test_the_road_repeats_after_its_length():
    renderer = RoadRenderer(CALTECH, "dashed", 3, periods=2)
    assert np.array_equal(
        renderer.render_grey(4.0, 0.2, 0.01), renderer.render_grey(4.0 + 2 * DASH_PERIOD, 0.2, 0.01)
    )


def test_equal_seeds_give_equal_bytes_in_any_order(standard):
    again = RoadRenderer(CALTECH, standard_look("dashed"), 3, periods=2)
    poses = [(0.0, 0.0, 0.0), (7.7, 0.3, -0.01), (19.0, -0.5, 0.02)]
    forth = [standard.render_grey(*pose) for pose in poses]
    back = [again.render_grey(*pose) for pose in reversed(poses)][::-1]
    assert all(np.array_equal(one, other) for one, other in zip(forth, back, strict=True))


def test_another_seed_gives_another_road(standard):
    assert not np.array_equal(
        standard.render_grey(0.0), RoadRenderer(CALTECH, "dashed", 4, periods=2).render_grey(0.0)
    )


def test_the_standard_road_has_realistic_grey_levels():
    picture = RoadRenderer(CALTECH, "solid", 1, periods=4).render_grey(0.0)
    left, right = (CALTECH.line_in_picture(y, 0.0) for y in (1.85, -1.85))
    row = 400
    assert 85 <= np.median(picture[row, 200:440]) <= 110
    assert (
        200 <= np.median([picture[row, round(right[0] * row + right[1])] for row in range(300, 470)]) <= 230
    )
    assert 170 <= np.median([picture[row, round(left[0] * row + left[1])] for row in range(300, 470)]) <= 190
    assert np.median(picture[:100]) > 170


def test_unknown_marks_are_refused():
    with pytest.raises(ValueError, match="dotted"):
        RoadRenderer(CALTECH, "dotted", 0)


def test_every_part_of_a_look_changes_the_image():
    base = replace(BARE, far_left=FRESH, far_right=FRESH)
    plain = RoadRenderer(UDACITY, base, 1, periods=1).render_grey(0.0)
    changes = {
        "lane_width": 3.3,
        "left": replace(FRESH, double=True),
        "right": replace(FRESH, fade=0.5),
        "far_left": None,
        "asphalt_tone": 150.0,
        "grain": 8.0,
        "mottle": 8.0,
        "wheel_track_darkening": 10.0,
        "shoulder_tone": 130.0,
        "shoulder_width": 1.0,
        "verge_tone": 140.0,
        "kerb_tone": 190.0,
        "patches_per_100_m": 300.0,
        "cracks_per_100_m": 300.0,
        "seams_per_100_m": 300.0,
        "joint_spacing": 4.5,
        "shadow_share": 0.3,
        "sky_tone": 160.0,
        "trees_tone": 120.0,
        "exposure": 0.7,
        "cars": (OtherCar(x=15.0, y=3.7),),
    }
    for name, value in changes.items():
        changed = RoadRenderer(UDACITY, replace(base, **{name: value}), 1, periods=1).render_grey(0.0)
        assert (changed != plain).mean() > 1e-4, name


def test_colours_keep_the_grey_values(standard):
    grey, colour = standard.render_grey(3.0, 0.2, 0.01), standard.render_colour(3.0, 0.2, 0.01)
    assert np.abs(cv2.cvtColor(colour, cv2.COLOR_BGR2GRAY).astype(int) - grey).mean() < 2.0
    blue, green, red = colour[20, 320].astype(int)
    assert blue > red
    blue, green, red = colour[200, 5].astype(int)
    assert green > blue and green > red
    a, b = CALTECH.line_in_picture(*standard.true_lines(0.2, 0.01)[0])
    blue, green, red = np.median([colour[row, round(a * row + b)] for row in range(300, 450)], axis=0)
    assert red > 2 * blue and green > 2 * blue


@pytest.mark.parametrize(("offset", "heading"), [(0.0, 0.0), (0.5, 0.02)])
def test_the_lead_is_drawn_at_its_distance(standard, offset, heading):
    lead = 20.0
    with_lead = standard.render_colour(3.0, offset, heading, lead=lead)
    changed = (with_lead != standard.render_colour(3.0, offset, heading)).any(axis=2)
    rows, columns = np.nonzero(changed)
    assert rows.max() == pytest.approx(CALTECH.row(lead + CAMERA_TO_BUMPER), abs=2.0)
    left, right = (CALTECH.line_in_picture(*line) for line in standard.true_lines(offset, heading))
    middle = 0.5 * ((left[0] + right[0]) * rows.max() + left[1] + right[1])
    assert 0.5 * (columns.min() + columns.max()) == pytest.approx(middle, abs=2.0)


def test_a_lead_that_cannot_be_seen_is_not_drawn(standard):
    plain = standard.render_colour(3.0)
    assert np.array_equal(plain, standard.render_colour(3.0, lead=-3.0))
    assert np.array_equal(plain, standard.render_colour(3.0, lead=500.0))


@pytest.mark.parametrize("lead", [2.0, 0.0, -0.5])
def test_a_lead_at_contact_fills_the_lane_ahead(standard, lead):
    """The picture of a contact must show what is hit, up to a lead that overlaps the front bumper."""
    changed = standard.render_colour(3.0, lead=lead) != standard.render_colour(3.0)
    rows, columns = np.nonzero(changed.any(axis=2))
    assert np.ptp(columns) == pytest.approx(1.8 * CALTECH.fx / (lead + CAMERA_TO_BUMPER), rel=0.35)
    assert abs(columns.mean() - CALTECH.cx) < 3.0
    assert rows.max() == pytest.approx(min(CALTECH.rows - 1, CALTECH.row(lead + CAMERA_TO_BUMPER)), abs=2.0)


def test_a_camera_below_the_roof_does_not_see_it():
    renderer = RoadRenderer(UDACITY, BARE, 0, periods=1)
    near, roof_free = (renderer.render_colour(3.0, lead=lead) for lead in (2.4, 2.6))
    tops = [np.nonzero((p != renderer.render_colour(3.0)).any(axis=2))[0].min() for p in (near, roof_free)]
    assert abs(int(tops[0]) - int(tops[1])) <= 3


def test_a_turn_pans_the_sky(standard):
    ahead, turned = standard.render_grey(0.0), standard.render_grey(0.0, 0.5, 0.05)
    shift = round(CALTECH.fx * np.tan(0.05) / np.cos(CALTECH.pitch))
    assert np.array_equal(turned[:150, shift:], ahead[:150, :-shift])
