"""The image library builds frames once, stores them safely and finds them by time or distance."""

import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
import selfdrive
from selfdrive.common.camera_model import CameraModel
from selfdrive.common.errors import ConfigError
from selfdrive.sim import image_library
from selfdrive.sim.image_library import (
    RENDERED_FRAMES,
    RENDERED_SPACING,
    FrameLibrary,
    map_or_make_frames,
    open_frame_library,
)
from selfdrive.sim.picture_options import DASHED_MARKS, PictureOptions
from selfdrive.sim.road_look import DASH_PERIOD
from selfdrive.sim.road_renderer import RoadRenderer

SHAPE = (5, 7, 9)  # an odd number of bytes per frame
DIGEST = "ab" * 32


def noise(seed=1):
    return iter(np.random.default_rng(seed).integers(0, 256, SHAPE, dtype=np.uint8))


def refuse():
    raise AssertionError("built again")


def library(**given):
    frames = np.zeros(SHAPE, np.uint8) + np.arange(5, dtype=np.uint8)[:, None, None]
    fields = {
        "name": "n",
        "digest": "d",
        "model": CameraModel(),
        "frames": frames,
        "spacing": None,
        "fps": None,
    }
    return FrameLibrary(**fields | given)


def test_frames_follow_the_distance_and_repeat():
    frames = library(spacing=2.0)
    assert [frames.frame(9.9, x)[0, 0] for x in (0.0, 1.9, 2.0, 9.0, 10.0, 13.0)] == [0, 0, 1, 4, 0, 1]


def test_frames_follow_the_time_and_repeat():
    frames = library(fps=10.0)
    times = [k * 0.05 for k in range(12)]
    assert [frames.frame(t, 99.0)[0, 0] for t in times] == [0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 0, 0]


def test_the_rendered_loop_has_whole_dash_periods():
    """At 60 mph, 20 frames pass per second."""
    periods = RENDERED_FRAMES * RENDERED_SPACING / DASH_PERIOD
    assert RENDERED_FRAMES >= 600
    assert periods == pytest.approx(round(periods))
    assert pytest.approx(60 * 0.44704 / 20, rel=0.001) == RENDERED_SPACING


def test_frames_are_built_once(tmp_path):
    first = map_or_make_frames(tmp_path, DIGEST, SHAPE, noise)
    again = map_or_make_frames(tmp_path, DIGEST, SHAPE, refuse)
    other = map_or_make_frames(tmp_path, "cd" * 32, SHAPE, lambda: noise(2))
    assert np.array_equal(first, np.stack(list(noise()))) and np.array_equal(first, again)
    assert not np.array_equal(first, other)
    with pytest.raises(ValueError, match="read-only"):
        again[0][0, 0] = 1
    assert len(list(tmp_path.iterdir())) == 2


@pytest.mark.parametrize(
    "harm",
    [
        lambda data: data[:-9],
        lambda data: data[:40],
        lambda data: b"",
        lambda data: data + b"0",
        lambda data: data[:200] + bytes([data[200] ^ 1]) + data[201:],
        lambda data: data[:128] + data[191:254] + data[128:191] + data[254:],
        lambda data: data[:128] + data[133:134] + data[129:133] + data[128:129] + data[134:],
        lambda data: data[:-40] + bytes([data[-40] ^ 1]) + data[-39:],
        lambda data: b"no array of numbers",
        lambda data: data[:128] + bytes(len(data) - 128),
        lambda data: b"PK\x03\x04" + data[4:],
        lambda data: data[:80] + b"(" + data[81:],
    ],
    ids=[
        *("short", "header only", "empty", "long", "one bit", "frames swapped", "bytes swapped", "digest"),
        *("other content", "zeros", "archive", "header"),
    ],
)
def test_a_damaged_file_is_detected_and_rebuilt(tmp_path, harm):
    map_or_make_frames(tmp_path, DIGEST, SHAPE, noise)
    (path,) = tmp_path.iterdir()
    path.write_bytes(harm(path.read_bytes()))
    assert np.array_equal(map_or_make_frames(tmp_path, DIGEST, SHAPE, noise), np.stack(list(noise())))
    assert len(list(map_or_make_frames(tmp_path, DIGEST, SHAPE, refuse))) == 5


def test_frames_are_verified_when_they_are_used(tmp_path):
    """Mapping a file takes almost no time. A damaged frame is rebuilt when it is used."""
    map_or_make_frames(tmp_path, DIGEST, SHAPE, noise)
    (path,) = tmp_path.iterdir()
    data = path.read_bytes()
    path.write_bytes(data[:128] + bytes([data[128] ^ 1]) + data[129:])
    frames, sound = map_or_make_frames(tmp_path, DIGEST, SHAPE, refuse), np.stack(list(noise()))
    assert np.array_equal(frames[4], sound[4])
    with pytest.raises(AssertionError, match="built again"):
        frames[0]


def test_frames_stay_in_memory_if_the_disk_returns_other_data(tmp_path, monkeypatch):
    map_or_make_frames(tmp_path, DIGEST, SHAPE, noise)
    real = image_library._map_cache_file

    def mapped(path, shape):
        frames, digests = real(path, shape)
        return np.zeros_like(frames), digests

    monkeypatch.setattr(image_library, "_map_cache_file", mapped)
    assert np.array_equal(map_or_make_frames(tmp_path, DIGEST, SHAPE, noise), np.stack(list(noise())))


def test_a_failed_build_leaves_no_file(tmp_path):
    def break_off():
        yield from list(noise())[:2]
        raise ConfigError("unreadable", where="0002.png", expected="a picture", remedy="replace it")

    with pytest.raises(ConfigError, match=r"0002\.png"):
        map_or_make_frames(tmp_path, DIGEST, SHAPE, break_off)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("place", [None, "file/cache", "x" * 300])
def test_frames_are_the_same_without_a_writable_cache(tmp_path, place):
    (tmp_path / "file").write_text("in the way")
    cache = None if place is None else tmp_path / place
    frames = map_or_make_frames(cache, DIGEST, SHAPE, noise)
    assert np.array_equal(frames, map_or_make_frames(tmp_path / "sound", DIGEST, SHAPE, noise))
    with pytest.raises(ValueError, match="read-only"):
        frames[0][0, 0] = 1
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "sound"]


def test_processes_can_build_the_same_frames_at_once(tmp_path):
    code = (
        "import numpy as np, hashlib, pathlib, sys\n"
        "from selfdrive.sim.image_library import map_or_make_frames\n"
        "make = lambda: iter(np.random.default_rng(1).integers(0, 256, (40, 97, 101), dtype=np.uint8))\n"
        f"frames = map_or_make_frames(pathlib.Path(sys.argv[1]), {DIGEST!r}, (40, 97, 101), make)\n"
        "print(hashlib.sha256(np.stack(list(frames)).tobytes()).hexdigest())\n"
    )
    root = str(Path(selfdrive.__path__[0]).parent)

    def run(_):
        command = [sys.executable, "-c", code, str(tmp_path)]
        return subprocess.run(
            command, env={"PYTHONPATH": root}, capture_output=True, text=True, check=True
        ).stdout

    with ThreadPoolExecutor(3) as pool:
        digests = set(pool.map(run, range(3)))
    assert len(digests) == 1
    assert len(list(tmp_path.iterdir())) == 1


@pytest.mark.slow
def test_the_rendered_library_has_the_renderers_frames(tmp_path):
    pictures = PictureOptions(marks=DASHED_MARKS, cache=tmp_path / "one")
    frames = open_frame_library(pictures, 5)
    assert frames.frames.shape == (600, 480, 640)
    assert (frames.name, frames.model) == ("rendered, dashed", CameraModel())
    drawn = RoadRenderer(CameraModel(), DASHED_MARKS, 5, periods=66).render_grey(100 * RENDERED_SPACING)
    assert np.array_equal(frames.frame(0.0, 100.5 * RENDERED_SPACING), drawn)
    elsewhere = open_frame_library(PictureOptions(marks=DASHED_MARKS, cache=tmp_path / "two"), 5)
    assert elsewhere.digest == frames.digest
    assert np.array_equal(elsewhere.frames, frames.frames)
    digests = {open_frame_library(PictureOptions(cache=tmp_path / "one"), seed).digest for seed in (5, 6)}
    assert len(digests | {frames.digest}) == 3
