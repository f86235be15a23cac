"""The command that counts missed lines under image effects, on frames of a rendered road."""

import csv
import json

import cv2
import numpy as np
import pytest
from selfdrive.sim.effects.effects_page import PANEL_SIZE, TITLE_HEIGHT
from selfdrive.sim.effects.levels import AMOUNTS_BY_EFFECT
from selfdrive.sim.road_renderer import RoadRenderer
from selfdrive.visiond_lab.evaluate_on_real_frames import EXIT_INVALID_INPUT, SOURCE_BY_KEY, UDACITY_MODEL
from selfdrive.visiond_lab.evaluate_under_effects import CSV_HEADER, PANELS_PER_ROW, main


@pytest.fixture(scope="module")
def frames(tmp_path_factory):
    folder = tmp_path_factory.mktemp("frames")
    road = RoadRenderer(UDACITY_MODEL, "solid", 1, periods=2)
    down = SOURCE_BY_KEY["p1"].vanishing_row * 640 / 960 - 200
    frame = cv2.warpAffine(road.render_grey(2.0), np.float32([[1, 0, 0], [0, 1, down]]), (640, 360))
    frame = cv2.resize(frame, (960, 540), interpolation=cv2.INTER_CUBIC)
    cv2.imwrite(str(folder / "p1_one.png"), cv2.merge([frame] * 3))
    left, right = (UDACITY_MODEL.line_in_picture(*line) for line in road.true_lines())
    (folder / "truth.json").write_text(json.dumps({"lines": {"p1_one": {"L": left, "R": right}}}))
    return [str(folder), str(folder / "truth.json")]


def test_misses_are_counted_by_level(frames, tmp_path, capsys):
    chosen = ["--effect", "PaperOcclusion", "--effect", "MedianBlur", "--seeds", "3"]
    assert main([*frames, *chosen, "--csv", str(tmp_path / "found.csv")]) == 0
    printed = capsys.readouterr().out.splitlines()
    with (tmp_path / "found.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert tuple(rows[0]) == CSV_HEADER
    assert [(row["effect"], row["pictures"]) for row in rows] == [("PaperOcclusion", "3")] * 10 + [
        ("MedianBlur", "1")
    ] * 2
    assert len(printed) == 1 + len(rows) and printed[-1].split() == ["MedianBlur", "2", "5", "1", "0", "0"]


def test_more_lines_are_missed_in_heavier_rain(frames, tmp_path):
    assert main([*frames, "--effect", "PaperRain", "--seeds", "2", "--csv", str(tmp_path / "found.csv")]) == 0
    with (tmp_path / "found.csv").open() as file:
        missed = [int(row["missed_paper"]) for row in csv.DictReader(file)]
    assert missed[0] < missed[-1] == 2


def test_strips_show_all_levels(frames, tmp_path):
    kinds = {kind.__name__: kind for kind in AMOUNTS_BY_EFFECT}
    for name in ("PaperRain", "GaussianBlur"):
        assert main([*frames, "--effect", name, "--strips", str(tmp_path)]) == 0
        strip = cv2.imread(str(tmp_path / f"{name}_p1_one.png"), cv2.IMREAD_GRAYSCALE)
        rows = -(-len(AMOUNTS_BY_EFFECT[kinds[name]]) // PANELS_PER_ROW)
        assert strip.shape == (rows * (PANEL_SIZE[1] + TITLE_HEIGHT), PANELS_PER_ROW * PANEL_SIZE[0])


def test_the_error_names_a_missing_frame(frames, tmp_path, capsys):
    assert main([str(tmp_path), frames[1]]) == EXIT_INVALID_INPUT
    assert "p1_one" in capsys.readouterr().err
