"""A film shows what the run did and does not affect the run."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from selfdrive.common.errors import ConfigError
from selfdrive.sim.film.recorded_film import load_film
from selfdrive.sim.run import main
from selfdrive.visiond.visiond import Visiond

SCENARIOS = Path(__file__).parents[4] / "fault_library" / "scenarios"


def outputs(folder):
    return [(folder / name).read_bytes() for name in ("trace.npz", "record.json")]


def test_a_run_is_the_same_with_a_film(drive):
    assert outputs(drive()) == outputs(drive(film=False))


def test_a_run_on_frames_is_the_same_with_a_film(drive, seeing):
    assert outputs(drive(*seeing)) == outputs(drive(*seeing, film=False))


def test_the_film_has_one_frame_for_each_camera_frame(drive):
    folder = drive()
    reel, trace = load_film(folder / "film"), np.load(folder / "trace.npz")
    assert [frame.t for frame in reel.frames] == list(trace["t"][::5])
    assert [frame.v_ego for frame in reel.frames] == list(trace["v_ego"][::5])
    assert [frame.d_rel for frame in reel.frames] == list(trace["d_rel"][::5])
    assert all(frame.picture is None for frame in reel.frames)


def test_the_film_has_the_detected_lines_and_lead(drive):
    frame = load_film(drive() / "film").frames[-1]
    assert (frame.lines["left"].y[0], frame.lines["right"].y[0]) == (1.85, -1.85)
    assert frame.lines["left"].prob == 1.0
    assert frame.camera_lead == frame.d_rel


def test_the_film_has_the_frames_that_the_detector_got(drive, seeing):
    frame = load_film(drive(*seeing) / "film").frames[0]
    own = cv2.imread(f"{seeing[2]}/0.png", cv2.IMREAD_GRAYSCALE)
    assert np.abs(frame.load_picture().astype(int) - own).mean() < 1.0


def test_a_film_for_stills_has_the_same_pictures_but_only_near_their_times(drive, seeing):
    """A still at a time after the end shows the last picture."""
    whole, still = drive(*seeing), drive(*seeing, "--film-at", "0.21", "--film-at", "9")
    assert outputs(whole) == outputs(still)
    names = [path.name for path in sorted((still / "film").iterdir())]
    assert names == ["00004.jpg", "00005.jpg", "00009.jpg", "film.jsonl"]
    assert all((still / "film" / name).read_bytes() == (whole / "film" / name).read_bytes() for name in names)


def test_a_picture_that_was_not_recorded_is_not_replaced_by_a_drawing(drive, seeing):
    frames = load_film(drive(*seeing, "--film-at", "0.2") / "film").frames
    with pytest.raises(ConfigError, match=r"00000\.jpg: unreadable"):
        frames[0].load_picture()


def test_times_of_stills_without_a_film_are_refused(tmp_path, capsys):
    words = ["--scenario", str(SCENARIOS / "S1.yaml"), "--out", str(tmp_path), "--film-at", "2"]
    assert main(words) == 2
    assert "--film-at 2, expected --film with it" in capsys.readouterr().err


def test_a_film_of_a_free_road_has_no_lead(drive):
    assert load_film(drive("--no-lead") / "film").frames[-1].d_rel is None


def test_without_a_camera_message_the_film_shows_no_lines(drive, monkeypatch):
    publish = Visiond.publish
    monkeypatch.setattr(Visiond, "publish", lambda own, model: model.t < 0.2 and publish(own, model))
    frames = load_film(drive() / "film").frames
    assert [frame.lines is not None for frame in frames] == [True] * 4 + [False] * 6
    assert frames[-1].camera_lead is None


def test_a_crashed_run_leaves_the_frames_before_the_crash(tmp_path, monkeypatch):
    publish = Visiond.publish

    def crash(own, model):
        assert model.t < 0.2
        publish(own, model)

    monkeypatch.setattr(Visiond, "publish", crash)
    words = ["--scenario", str(SCENARIOS / "S1.yaml"), "--out", str(tmp_path)]
    with pytest.raises(AssertionError):
        main([*words, "--film", str(tmp_path / "film")])
    assert len(load_film(tmp_path / "film").frames) == 4


def test_a_film_folder_that_cannot_be_created_is_an_error(tmp_path, capsys):
    (tmp_path / "file").touch()
    words = ["--scenario", str(SCENARIOS / "S1.yaml"), "--out", str(tmp_path / "out")]
    assert main([*words, "--film", str(tmp_path / "file" / "film")]) == 2
    assert "file/film" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_full_disk_ends_the_run_with_an_error(tmp_path, seeing, capsys):
    (tmp_path / "film").mkdir()
    (tmp_path / "film" / "00001.jpg").symlink_to("/dev/full")
    words = ["--scenario", str(SCENARIOS / "S1.yaml"), "--out", str(tmp_path / "out"), *seeing]
    assert main([*words, "--film", str(tmp_path / "film")]) == 2
    assert f"{tmp_path}/film: No space left" in capsys.readouterr().err


@pytest.mark.parametrize("text", ["", "{}\n", '{"schema": "film/1", "camera": {}}\n', "not JSON\n"])
def test_an_invalid_film_file_is_an_error(tmp_path, text):
    (tmp_path / "film.jsonl").write_text(text)
    with pytest.raises(ConfigError, match=r"film\.jsonl: unreadable"):
        load_film(tmp_path)
