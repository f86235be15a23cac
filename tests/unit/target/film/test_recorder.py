"""A film shows what the run did and does not affect the run."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from selfdrive.common.errors import ConfigError
from selfdrive.sim.film.reel import read_reel
from selfdrive.sim.run import main
from selfdrive.visiond.visiond import Visiond

SCENARIOS = Path(__file__).parents[4] / "fault_library" / "scenarios"


def outputs(folder):
    return [(folder / name).read_bytes() for name in ("trace.npz", "record.json")]


def test_a_run_is_the_same_with_a_film(drive):
    assert outputs(drive()) == outputs(drive(film=False))


def test_a_run_with_pictures_is_the_same_with_a_film(drive, seeing):
    assert outputs(drive(*seeing)) == outputs(drive(*seeing, film=False))


def test_one_frame_for_each_look_of_the_camera(drive):
    """The film has twenty frames a second, with the times, speeds and distances of the trace."""
    folder = drive()
    reel, trace = read_reel(folder / "film"), np.load(folder / "trace.npz")
    assert [frame.t for frame in reel.frames] == list(trace["t"][::5])
    assert [frame.v_ego for frame in reel.frames] == list(trace["v_ego"][::5])
    assert [frame.d_rel for frame in reel.frames] == list(trace["d_rel"][::5])
    assert all(frame.picture is None for frame in reel.frames)


def test_what_was_seen_is_kept(drive):
    """With ideal vision, the film shows both lines and the lead where they are."""
    frame = read_reel(drive() / "film").frames[-1]
    assert (frame.lines["left"].y[0], frame.lines["right"].y[0]) == (1.85, -1.85)
    assert frame.lines["left"].prob == 1.0
    assert frame.camera_lead == frame.d_rel


def test_pictures_are_kept_as_the_detector_had_them(drive, seeing):
    frame = read_reel(drive(*seeing) / "film").frames[0]
    own = cv2.imread(f"{seeing[2]}/0.png", cv2.IMREAD_GRAYSCALE)
    assert np.abs(frame.image().astype(int) - own).mean() < 1.0


def test_a_free_road_has_no_lead(drive):
    assert read_reel(drive("--no-lead") / "film").frames[-1].d_rel is None


def test_a_camera_that_says_nothing_has_seen_nothing(drive, monkeypatch):
    """If visiond publishes nothing, the film shows no lines, not those of the previous message."""
    publish = Visiond.publish
    monkeypatch.setattr(Visiond, "publish", lambda own, model: model.t < 0.2 and publish(own, model))
    frames = read_reel(drive() / "film").frames
    assert [frame.lines is not None for frame in frames] == [True] * 4 + [False] * 6
    assert frames[-1].camera_lead is None


def test_a_run_that_breaks_off_leaves_what_went_before(tmp_path, monkeypatch):
    publish = Visiond.publish

    def crash(own, model):
        assert model.t < 0.2
        publish(own, model)

    monkeypatch.setattr(Visiond, "publish", crash)
    words = ["--scenario", str(SCENARIOS / "S1.yaml"), "--out", str(tmp_path)]
    with pytest.raises(AssertionError):
        main([*words, "--film", str(tmp_path / "film")])
    assert len(read_reel(tmp_path / "film").frames) == 4


def test_a_film_that_cannot_be_written(tmp_path, capsys):
    """If the folder cannot be created, the error names it and nothing runs."""
    (tmp_path / "file").touch()
    words = ["--scenario", str(SCENARIOS / "S1.yaml"), "--out", str(tmp_path / "out")]
    assert main([*words, "--film", str(tmp_path / "file" / "film")]) == 2
    assert "file/film" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_film_that_cannot_be_kept_any_longer(tmp_path, seeing, capsys):
    """If the disk is full at the second frame, the run ends with an error that names the folder."""
    (tmp_path / "film").mkdir()
    (tmp_path / "film" / "00001.jpg").symlink_to("/dev/full")
    words = ["--scenario", str(SCENARIOS / "S1.yaml"), "--out", str(tmp_path / "out"), *seeing]
    assert main([*words, "--film", str(tmp_path / "film")]) == 2
    assert f"{tmp_path}/film: No space left" in capsys.readouterr().err


@pytest.mark.parametrize("text", ["", "{}\n", '{"schema": "film/1", "camera": {}}\n', "not JSON\n"])
def test_what_is_no_film_is_told(tmp_path, text):
    (tmp_path / "film.jsonl").write_text(text)
    with pytest.raises(ConfigError, match=r"film\.jsonl: no film"):
        read_reel(tmp_path)
