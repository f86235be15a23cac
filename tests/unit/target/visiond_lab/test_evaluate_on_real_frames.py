"""The command that compares detected lanes with true lanes."""

import json
from functools import cache

import cv2
import numpy as np
import pytest
from selfdrive.sim.road_renderer import RoadRenderer
from selfdrive.visiond_lab.evaluate_on_real_frames import (
    SOURCE_BY_KEY,
    TUSIMPLE_MODEL,
    UDACITY_MODEL,
    main,
    to_canonical_frame,
)


@cache
def _road(model):
    return RoadRenderer(model, "solid", 1, periods=2)


@pytest.fixture
def frames(tmp_path):
    """A folder with frames of two cameras. In truth.json, one frame has lines and the other has centres."""
    folder = tmp_path / "frames"
    (folder / "deep").mkdir(parents=True)
    lines = {}
    for key, name, model in (
        ("p1_one", "one.png", UDACITY_MODEL),
        ("tus_two", "deep/tus_two.png", TUSIMPLE_MODEL),
    ):
        road = _road(model)
        left, right = (model.line_in_picture(y, slope) for y, slope in road.true_lines(0.2, 0.01))
        source = SOURCE_BY_KEY[key.partition("_")[0]]
        down = source.vanishing_row * 640 / (960 if key.startswith("p1") else 1280) - 200
        frame = cv2.warpAffine(
            road.render_grey(2.0, 0.2, 0.01), np.float32([[1, 0, 0], [0, 1, down]]), (640, 360)
        )
        width = 960 if key.startswith("p1") else 1280
        frame = cv2.resize(frame, (width, width * 9 // 16), interpolation=cv2.INTER_CUBIC)
        assert cv2.imwrite(str(folder / name), cv2.merge([frame] * 3))
        lines[key] = {"L": left, "R": right}
    lines["tus_two"] = {"gt": [a * 278 + b for a, b in lines["tus_two"].values()]}
    _write(tmp_path, lines)
    return tmp_path


def _write(folder, lines):
    (folder / "truth.json").write_text(json.dumps({"frame": "canonical", "lines": lines}))


def _run(folder, *more):
    return main([str(folder / "frames"), str(folder / "truth.json"), "--detector", "robust", *more])


def _lines(folder):
    return json.loads((folder / "truth.json").read_text())["lines"]


def test_the_share_of_frames_with_both_lines_is_printed(frames, capsys):
    assert _run(frames, "--overlays", str(frames / "drawn")) == 0
    out = capsys.readouterr().out
    assert "both lines found in 2 of 2 = 100.0%" in out and "p1_one" in out and "tus_two" in out
    drawn = cv2.imread(str(frames / "drawn" / "robust_p1_one.png"))
    blue, green, red = (drawn[..., i].astype(int) for i in range(3))
    assert ((green - red > 60) & (green - blue > 60)).sum() > 200, "the found lines are not green"
    assert ((red - green > 60) & (red - blue > 60)).sum() > 8, "the true lines are not red"


def test_a_line_off_by_more_than_the_limit_is_a_miss(frames, capsys):
    lines = _lines(frames)
    lines["p1_one"]["L"][1] -= 30.0
    _write(frames, lines)
    assert _run(frames) == 0
    out = capsys.readouterr().out
    assert "MISSED" in out and "both lines found in 1 of 2 = 50.0%" in out


def test_a_line_that_was_not_seen_is_a_miss(frames, capsys):
    """The lane that the detector assumes is not a hit."""
    cv2.imwrite(str(frames / "frames" / "one.png"), np.full((540, 960, 3), 90, np.uint8))
    _write(frames, {"p1_one": _lines(frames)["p1_one"]})
    assert _run(frames) == 0
    out = capsys.readouterr().out
    assert "not found" in out and "0 of 1" in out


def test_lines_take_precedence_over_centres(frames, capsys):
    lines = _lines(frames)
    lines["p1_one"]["gt"] = {"L": 1.0, "R": 2.0}
    _write(frames, lines)
    assert _run(frames) == 0
    assert "2 of 2" in capsys.readouterr().out


def test_centres_are_used_if_the_lines_are_null(frames, capsys):
    lines = _lines(frames)
    left, right = (lines["p1_one"][side] for side in "LR")
    lines["p1_one"] = {
        "L": None,
        "R": None,
        "gt": {"L": left[0] * 278 + left[1], "R": right[0] * 278 + right[1]},
    }
    _write(frames, lines)
    assert _run(frames) == 0
    assert "2 of 2" in capsys.readouterr().out


def test_frames_of_the_same_name_are_distinguished_by_folder(frames, capsys):
    folder = frames / "frames"
    for camera in ("p1", "tus"):
        (folder / camera).mkdir()
        cv2.imwrite(str(folder / camera / "one.png"), np.zeros((540, 960, 3), np.uint8))
    (folder / "one.png").rename(folder / "p1" / "one.png")
    assert _run(frames) == 0
    assert "2 of 2" in capsys.readouterr().out
    (folder / "p1").rename(folder / "other")
    (folder / "tus").rename(folder / "another")
    assert _run(frames) == 2
    assert "p1_one" in capsys.readouterr().err


def test_the_error_names_an_overlay_that_cannot_be_written(frames, capsys):
    (frames / "drawn").write_text("in the way")
    assert _run(frames, "--overlays", str(frames / "drawn")) == 2
    assert "drawn/robust_p1_one.png" in capsys.readouterr().err


def test_the_folders_camera_file_is_used(frames, capsys):
    (frames / "frames" / "camera.yaml").write_text(
        "schema: camera/1\nname: mine\nfiles: '*.png'\nwidth: 960\nrows: 540\n"
        "horizon_row: 318\nfocal_px: 868.5\nheight_m: 1.21\nfps: 20\n"
    )
    for number in (3, 4, 9):  # not a sequence: the truth file lists the frames
        (frames / "frames" / f"{number}.png").write_bytes(b"")
    _write(frames, {"one": _lines(frames)["p1_one"]})
    assert _run(frames) == 0
    assert "1 of 1" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        ({"p1_none": {"gt": [100, 300]}}, "p1_none"),
        ({"else_one": {"gt": [100, 300]}}, "camera.yaml"),
        ({"p1_one": {"gt": [300, 100]}}, "left of the right one"),
        ({"p1_one": {"L": [1.0, 2.0]}}, "p1_one"),
        ({"p1_one": 5}, "p1_one"),
        ({}, "no lines"),
        (None, "lines"),
    ],
)
def test_the_error_names_a_wrong_entry(frames, capsys, lines, words):
    _write(frames, lines)
    assert _run(frames) == 2
    error = capsys.readouterr().err
    assert error.startswith("error: ") and words in error


def test_the_error_names_an_unreadable_frame(frames, capsys):
    (frames / "frames" / "one.png").write_bytes(b"no picture")
    assert _run(frames) == 2
    assert "one.png" in capsys.readouterr().err


def test_the_error_names_a_missing_truth_file(frames, capsys):
    (frames / "truth.json").unlink()
    assert _run(frames) == 2
    assert "truth.json" in capsys.readouterr().err


@pytest.mark.parametrize("width", [640, 960, 1280])
def test_the_canonical_frame_has_its_vanishing_row_at_200(width):
    rows = width * 9 // 16
    frame = np.zeros((rows, width, 3), np.uint8)
    row = round(425 / 720 * rows)
    frame[row - width // 640 : row + width // 640] = 255
    seen = to_canonical_frame(frame, SOURCE_BY_KEY["adv"])
    assert seen.shape == (480, 640, 3)
    weight = seen[:, 320, 0].astype(float)
    assert (weight @ np.arange(480)) / weight.sum() == pytest.approx(200, abs=1.0)
