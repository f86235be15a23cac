"""Videos, stills and the command that writes them."""

import json

import cv2
import numpy as np
import pytest
from PIL import Image
from selfdrive.common.errors import ConfigError
from selfdrive.sim.film import drawing
from selfdrive.sim.film.__main__ import main
from selfdrive.sim.film.encode import write_still, write_video

EVENTS = {
    "schema": "film-events/1",
    "title": "a fault",
    "outcome": "masked",
    "active": None,
    "marks": [],
    "names": {},
}


def pictures(count=8):
    for number in range(count):
        picture = np.full((180, 320, 3), 60 + 10 * number, np.uint8)
        picture[:40] = drawing.FAULTY
        yield picture


def frames_of(path):
    video, found = cv2.VideoCapture(str(path)), []
    while True:
        there, picture = video.read()
        if not there:
            return found
        found.append(picture)


def test_an_mp4_shows_every_picture_at_20_per_second(tmp_path):
    write_video(pictures(), tmp_path / "a.mp4")
    found = frames_of(tmp_path / "a.mp4")
    assert [picture.shape for picture in found] == [(180, 320, 3)] * 8
    assert [float(picture[100:].mean()) for picture in found] == pytest.approx(
        [60 + 10 * number for number in range(8)], abs=4
    )
    assert cv2.VideoCapture(str(tmp_path / "a.mp4")).get(cv2.CAP_PROP_FPS) == 20


def test_a_gif_plays_at_the_same_speed(tmp_path):
    write_video(pictures(), tmp_path / "a.gif")
    with Image.open(tmp_path / "a.gif") as gif:
        assert (gif.n_frames, gif.info["duration"], gif.size) == (2, 200, (800, 450))
        assert gif.convert("RGB").getpixel((400, 20)) == drawing.FAULTY[::-1]


def test_other_formats_are_refused(tmp_path):
    with pytest.raises(ConfigError, match=r"\.mp4 or \.gif"):
        write_video(pictures(), tmp_path / "a.avi")
    with pytest.raises(ConfigError, match=r"\.png"):
        write_still(next(pictures()), tmp_path / "a.tiff")
    assert not list(tmp_path.iterdir())


def test_an_error_names_a_file_that_cannot_be_written(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(ConfigError, match=r"a\.png"):
        write_still(next(pictures()), tmp_path / "file" / "a.png")


@pytest.mark.parametrize(("name", "words"), [("a.gif", ()), ("a.png", ("--at", "0.3"))])
def test_the_command_writes_the_same_bytes_each_time(drive, tmp_path, name, words):
    (tmp_path / "events.json").write_text(json.dumps(EVENTS))
    film = str(drive() / "film")
    for folder in ("x", "y"):
        sides = ["--golden", film, "--faulty", film, "--events", str(tmp_path / "events.json")]
        assert main([*sides, "--out", str(tmp_path / folder / name), *words]) == 0
    assert (tmp_path / "x" / name).read_bytes() == (tmp_path / "y" / name).read_bytes()


def test_invalid_input_gives_code_2_and_one_line_of_error(tmp_path, capsys):
    folder = str(tmp_path)
    words = ["--golden", folder, "--faulty", folder, "--events", folder, "--out", f"{folder}/a.mp4"]
    assert main(words) == 2
    error = capsys.readouterr().err
    assert "film.jsonl: unreadable" in error
    assert error.count("\n") == 1


@pytest.mark.parametrize("name", ["a.mp4", "a.gif", "a.png"])
def test_an_error_names_the_file_if_the_disk_is_full(tmp_path, name):
    path = tmp_path / name
    path.symlink_to("/dev/full")
    with pytest.raises(ConfigError, match=f"{name}: No space left on device"):
        if name == "a.png":
            write_still(next(pictures()), path)
        else:
            write_video(pictures(), path)
