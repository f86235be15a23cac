"""The sheet shows two runs side by side, even if a fault makes perception report impossible values."""

import json
from dataclasses import replace

import cv2
import numpy as np
import pytest
from selfdrive.common.camera_model import CameraModel
from selfdrive.common.errors import ConfigError
from selfdrive.sim.film import drawing
from selfdrive.sim.film.camera_pane import CameraPane
from selfdrive.sim.film.film_events import FilmEvents, TimelineMark, load_film_events
from selfdrive.sim.film.recorded_film import DetectedLine
from selfdrive.sim.film.side_by_side import HEADING_HEIGHT, HEIGHT, MARGIN, PANE_SIZE, WIDTH, SideBySideView

EVENTS = FilmEvents(
    title="a fault", outcome="hazard", active_span=None, marks=(), hazard_names={"H3": "out of lane"}
)


def is_drawn(picture, colour):
    return bool((np.abs(picture.astype(int) - colour).max(axis=-1) <= 40).any())


def pane_of(sheet, side):
    left = MARGIN if side == "golden" else WIDTH - MARGIN - PANE_SIZE[0]
    return sheet[HEADING_HEIGHT : HEADING_HEIGHT + PANE_SIZE[1], left : left + PANE_SIZE[0]]


def test_detected_lines_lie_on_the_painted_ones(frame):
    pane = CameraPane(CameraModel(), *PANE_SIZE)
    without, with_lines = pane.draw(frame(lines=None, d_rel=None)), pane.draw(frame(d_rel=None))
    yellow = (without[..., 2].astype(int) - without[..., 0] > 90).sum()
    left = (with_lines[..., 2].astype(int) - with_lines[..., 0] > 90).sum()
    assert yellow > 500
    assert left < 0.35 * yellow


def test_detected_lines_lie_on_the_painted_ones_in_a_bend(frame):
    bend = tuple(0.001 * x * x for x in range(0, 50, 7))
    lines = {"left": DetectedLine(y=tuple(1.85 + y for y in bend), prob=1.0)}
    pane = CameraPane(CameraModel(), *PANE_SIZE)
    without = pane.draw(frame(lines=None, d_rel=None, bend=bend, plan=bend))
    covered = pane.draw(frame(lines=lines, d_rel=None, bend=bend, plan=bend))
    yellow = (without[..., 2].astype(int) - without[..., 0] > 90).sum()
    assert yellow > 500
    assert (covered[..., 2].astype(int) - covered[..., 0] > 90).sum() < 0.4 * yellow


def test_the_lead_is_drawn_and_outlined_at_contact(frame):
    """The still of a contact must show the vehicle that is hit, with its distance."""
    pane = CameraPane(CameraModel(), *PANE_SIZE)
    hit = pane.draw(frame(lines=None, d_rel=-0.1, camera_lead=None))
    free = pane.draw(frame(lines=None, d_rel=None, camera_lead=None))
    changed = (hit != free).any(axis=2)
    assert changed.mean() > 0.15
    assert is_drawn(hit[changed], drawing.INK)


def wrong_lines(y, prob):
    return {"lines": dict.fromkeys(("left", "right"), DetectedLine(y=(y,) * 8, prob=prob))}


def test_impossible_values_can_be_drawn(reel):
    nan, infinite = float("nan"), float("inf")
    wrong = [
        {"lines": None, "camera_lead": None},
        wrong_lines(nan, 1.0),
        wrong_lines(1e300, 1.0),
        wrong_lines(1.0, infinite),
        {"plan": (-infinite,) * 8, "camera_lead": nan},
        {"camera_lead": -5.0, "d_rel": -1.0, "radar": 1e9},
        {"d_rel": None, "radar": None},
        {"offset": 300.0, "middle": -300.0, "heading": 1.2},
    ]
    sheet = SideBySideView(reel({}), reel(*wrong), EVENTS)
    assert [sheet.draw(index).shape for index in range(len(wrong))] == [(HEIGHT, WIDTH, 3)] * len(wrong)


def test_hazards_and_alerts_are_shown_on_the_side_of_their_run(reel):
    faulty = reel({}, {"hazards": ("H3",)}, {"alerts": ("steer_saturated",), "text": "Take control"})
    sheet = SideBySideView(reel({}, {}, {}), faulty, EVENTS)
    for index, colour in ((1, drawing.HAZARD), (2, drawing.ALERT)):
        foot = {side: pane_of(sheet.draw(index), side)[-24:-6] for side in ("golden", "faulty")}
        assert is_drawn(foot["faulty"], colour)
        assert not is_drawn(foot["golden"], colour)


def test_the_startup_reminder_is_not_shown_as_an_alert(reel):
    plain, reminded = reel({}), reel({"alerts": ("startup",), "text": "Hands on the wheel"})
    sheet = SideBySideView(plain, reminded, EVENTS).draw(0)
    assert (pane_of(sheet, "faulty")[-60:] == pane_of(sheet, "golden")[-60:]).all()


def test_the_sheet_marks_the_time_when_the_fault_is_active(reel):
    events = FilmEvents(title="", outcome="sdc", active_span=(0.05, 0.05), marks=(), hazard_names={})
    sheet = SideBySideView(reel({}, {}, {}), reel({}, {}, {}), events)
    corners = [pane_of(sheet.draw(i), "faulty")[9:11, -100:-10] for i in range(3)]
    assert [bool((corner == drawing.TRIGGER).all()) for corner in corners] == [False, True, False]


def test_the_last_frame_of_a_shorter_film_stays(reel):
    sheet = SideBySideView(reel({}, {}, {}), reel({}), EVENTS)
    assert sheet.picture_count == 3
    assert pane_of(sheet.draw(2), "faulty").mean() < 0.7 * pane_of(sheet.draw(0), "faulty").mean()
    assert sheet.time_of(2) == pytest.approx(0.1)


def test_nearest_returns_the_frame_nearest_to_a_time(reel):
    sheet = SideBySideView(reel({}, {}, {}), reel({}, {}, {}), EVENTS)
    assert [sheet.nearest_index(t) for t in (-1.0, 0.06, 99.0)] == [0, 1, 2]


def test_marks_are_drawn_at_their_times(reel):
    frames = [{}] * 41
    marked = FilmEvents(
        title="",
        outcome="hazard",
        active_span=None,
        marks=(TimelineMark(kind="hazard", t=1.0, label="H1"),),
        hazard_names={},
    )
    with_mark, without = (
        SideBySideView(reel(*frames), reel(*frames), events).draw(0)[600:] for events in (marked, EVENTS)
    )
    columns = np.flatnonzero((with_mark != without).any(axis=(0, 2)))
    middle = 86 + (WIDTH - 96) / 2
    assert columns.size
    assert abs(columns.min() - middle) <= 2


def test_the_sheet_is_grey_after_the_end_of_the_drive(reel):
    frames = [{"d_rel": 20.0}] * 21 + [{"d_rel": 500.0}] * 20
    ended, whole = (
        SideBySideView(reel(*frames), reel(*frames), replace(EVENTS, drive_end=end)) for end in (1.0, None)
    )
    assert (ended.draw(20)[:580] == whole.draw(20)[:580]).all()
    later = ended.draw(21)
    for side in ("golden", "faulty"):
        pane = pane_of(later, side)
        assert (pane.max(axis=-1) == pane.min(axis=-1)).all()
    right = later[600:, WIDTH - 200 :]
    assert (right.max(axis=-1) == right.min(axis=-1)).all()
    assert (later[600:, :600] != whole.draw(21)[600:, :600]).any()  # the plots have another scale


def test_frames_of_another_shape_fit_the_sheet(reel, tmp_path, frame):
    cv2.imwrite(str(tmp_path / "a.jpg"), np.full((720, 1280), 128, np.uint8))
    model = CameraModel.from_view(width=1280, rows=720, horizon=300.0, focal=1000.0, height=1.4)
    wide = replace(reel({"picture": tmp_path / "a.jpg", "d_rel": None}), camera=model)
    pane = pane_of(SideBySideView(wide, wide, EVENTS).draw(0), "golden")
    assert (pane[40] == drawing.PANEL).all()
    assert abs(int(pane[70, 5, 0]) - 128) < 3


def test_events_are_read_and_other_content_is_refused(tmp_path):
    path = tmp_path / "events.json"
    mark = {"kind": "alert", "t": 3.0, "label": "fcw"}
    path.write_text(
        json.dumps(
            {
                "schema": "film-events/1",
                "title": "x",
                "outcome": "sdc",
                "active": [1.0, 2.0],
                "marks": [mark],
                "names": {},
            }
        )
    )
    events = load_film_events(path)
    assert (events.active_span, events.marks) == ((1.0, 2.0), (TimelineMark(**mark),))
    path.write_text("{}")
    with pytest.raises(ConfigError, match=r"events\.json: unreadable"):
        load_film_events(path)
