"""Judging detectors: what can be seen of a line, and what is said about it."""

import numpy as np
import pytest
from selfdrive.sim.effects import Contrast, PaperFog
from selfdrive.visiond.detector import RoadLine
from selfdrive.visiond_lab import judge_detectors
from selfdrive.visiond_lab.judge_detectors import (
    Judgement,
    Verdicts,
    count_verdicts,
    judge,
    largest_gain,
    wilson_interval,
)
from selfdrive.visiond_lab.judged_frames import (
    JudgedFrame,
    affect_frame,
    measure_seen_shares_behind_effect,
    render_frames,
)


@pytest.fixture(scope="module")
def frames() -> list[JudgedFrame]:
    return list(render_frames(2, (1, 2)))


def test_equal_seeds_give_equal_roads(frames):
    (again,) = render_frames(1, (1, 2))
    assert np.array_equal(again.picture, frames[0].picture)
    assert not np.array_equal(frames[0].picture, frames[1].picture)


def test_only_the_lanes_lines_are_missing_from_the_frame_without_lines(frames):
    """All of a clean line's pixels are seen; nothing is seen of a line that both frames lack."""
    for frame in frames:
        assert frame.measure_seen_shares(frame.picture, frame.without_lines) == [1.0, 1.0]
        assert frame.measure_seen_shares(frame.without_lines, frame.without_lines) == [0.0, 0.0]


def test_a_line_is_right_within_the_tolerance(frames):
    frame = frames[0]
    for side in (0, 1):
        a, b = 0.0, frame.columns[side]
        for off, right in ((0.9, True), (1.1, False)):
            y, slope = frame.model.line_on_road(a, b + off * frame.tolerance)
            assert frame.is_right(side, RoadLine(y=y, slope=slope)) is right


def test_a_line_behind_white_or_haze_is_seen_less(frames):
    """A gain of ten makes road and paint equally white."""
    frame = frames[0]
    assert max(measure_seen_shares_behind_effect(frame, Contrast, 10.0, 1)) == 0.0
    assert min(measure_seen_shares_behind_effect(frame, PaperFog, 1, 1)) > 0.9
    assert affect_frame(frame, Contrast, 10.0, 1).shape == frame.picture.shape


def test_verdicts_are_shares_of_the_lines_that_can_be_seen():
    lines = (
        *[(1.0, True, 0.9)] * 3,  # found
        (0.5, False, 0.5),  # wrong
        *[(0.9, False, 0.4), (0.9, True, 0.0)],  # abstained
        *[(0.4, False, 0.9), (0.1, True, 0.9)],  # hardly seen; one of them wrong
    )
    judgements = [Judgement("robust", "Rain", 5, *line) for line in lines]
    assert count_verdicts(judgements) == [Verdicts("robust", "Rain", 5, 6, 3, 1, 2, 2, 1)]


def test_a_stronger_level_that_is_found_more_often_is_told():
    levels = [
        Verdicts("paper", "Rain", level, 10, found, 0, 10 - found, 0, 0)
        for level, found in ((1, 8), (5, 9), (10, 4))
    ]
    assert largest_gain(levels) == pytest.approx(0.1)
    assert largest_gain(levels[1:]) == 0.0


def test_the_interval_of_twelve_lines_is_wide():
    """Wilson's interval for 12 of 12, by hand: from 12 / (12 + 1.96^2) to 1."""
    assert wilson_interval(1.0, 12) == pytest.approx((12 / (12 + 1.96**2), 1.0))


def test_each_effect_has_its_turn(frames):
    kinds = [PaperFog, Contrast]
    judged = list(judge(frames, kinds, seeds=1, turns=2, detectors=["robust"]))
    effects = [judgement[1:3] for judgement in judged]
    assert effects[::2] == effects[1::2]  # left and right
    assert effects[::2] == [
        *[("clean", 0), *(("PaperFog", level) for level in (1, 5, 10))],
        *[("clean", 0), *(("Contrast", level) for level in (1, 5, 10))],
    ]


def test_the_command_prints_and_writes_the_counts(tmp_path, capsys):
    path = tmp_path / "counts.csv"
    arguments = ["--roads", "1", "--effect", "Contrast", "--detector", "robust", "--csv", str(path)]
    assert judge_detectors.main(arguments) == 0
    assert "against the order of levels" in capsys.readouterr().out
    header, *rows = path.read_text().splitlines()
    assert header == ",".join(Verdicts._fields)
    assert [row.split(",")[:3] for row in rows] == [
        *[["robust", "Contrast", str(level)] for level in (1, 5, 10)],
        ["robust", "clean", "0"],
    ]


def test_a_folder_without_frames_is_refused(tmp_path, capsys):
    assert judge_detectors.main(["--frames", str(tmp_path), str(tmp_path / "none.json")]) == 2
    assert "none.json" in capsys.readouterr().err


@pytest.mark.parametrize("option", ["--roads", "--seeds"])
@pytest.mark.parametrize("value", ["0", "-1", "1.5", "many"])
def test_a_count_below_one_is_refused(option, value, capsys):
    with pytest.raises(SystemExit, match="2"):
        judge_detectors.main([f"{option}={value}"])
    assert f"argument {option}: '{value}' is not a whole number of 1 or more" in capsys.readouterr().err
