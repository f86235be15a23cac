"""A user's own frames: calibration, order, and errors that name the file."""

import re
import struct
import zlib
from dataclasses import astuple
from pathlib import Path

import cv2
import numpy as np
import pytest
from selfdrive.common.camera_model import CameraModel
from selfdrive.common.errors import ConfigError
from selfdrive.sim.image_folder import ImageFolder
from selfdrive.sim.image_library import open_frame_library
from selfdrive.sim.picture_options import PictureOptions

PAGE = Path(__file__).parents[4] / "docs" / "how-to" / "use-your-own-frames.md"
VIEW = """\
schema: camera/1
name: test drive
files: "*.png"
width: 64
rows: 48
horizon_row: 20
focal_px: 60
height_m: 1.4
fps: 20
"""
CALTECH = """\
schema: camera/1
name: caltech
files: "*.png"
width: 640
rows: 480
fx_px: 309.4
fy_px: 344.2
cx_px: 317.9
cy_px: 256.5
height_m: 2.18
pitch_deg: 14
spacing_m: 1.34
"""


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "camera.yaml").write_text(VIEW)
    for number in range(1, 13):
        cv2.imwrite(str(tmp_path / f"{number}.png"), np.full((48, 64, 3), 10 * number, np.uint8))
    return tmp_path


def test_frames_are_read_in_the_order_of_their_numbers(folder):
    frames = list(ImageFolder(folder).decode_frames())
    assert [frame[0, 0] for frame in frames] == list(range(10, 121, 10))
    assert {frame.shape for frame in frames} == {(48, 64)}


def test_a_folder_becomes_a_library(folder, tmp_path):
    library = open_frame_library(PictureOptions(frames=folder, cache=tmp_path / "cache"), 0)
    assert library.name == "test drive"
    assert (library.fps, library.spacing) == (20.0, None)
    assert library.frame(0.55, 0.0)[0, 0] == 120 and library.frame(0.6, 0.0)[0, 0] == 10
    assert library.model.horizon == pytest.approx(20.0)


def test_the_digest_changes_with_frames_and_calibration(folder, tmp_path):
    digests = {ImageFolder(folder).digest}
    cv2.imwrite(str(folder / "7.png"), np.full((48, 64), 71, np.uint8))
    digests.add(ImageFolder(folder).digest)
    (folder / "camera.yaml").write_text(VIEW.replace("height_m: 1.4", "height_m: 1.5"))
    digests.add(ImageFolder(folder).digest)
    assert len(digests) == 3


def test_a_full_calibration_gives_that_camera(folder):
    (folder / "camera.yaml").write_text(CALTECH)
    read = ImageFolder(folder)
    assert astuple(read.model) == pytest.approx(astuple(CameraModel()))
    assert (read.fps, read.spacing) == (None, 1.34)


def test_resizing_scales_frames_and_camera(folder):
    full = ImageFolder(folder).model
    (folder / "camera.yaml").write_text(VIEW + "resize_width: 32\n")
    half = ImageFolder(folder)
    assert {frame.shape for frame in half.decode_frames()} == {(24, 32)}
    column, row = full.project(9.0, 1.2, 0.0)
    assert half.model.project(9.0, 1.2, 0.0) == pytest.approx((0.5 * column - 0.25, 0.5 * row - 0.25))


def error(folder):
    with pytest.raises(ConfigError) as caught:
        list(ImageFolder(folder).decode_frames())
    return str(caught.value)


def test_the_error_names_a_frame_of_another_size(folder):
    cv2.imwrite(str(folder / "7.png"), np.zeros((60, 80), np.uint8))
    assert error(folder).startswith(f"{folder}/7.png: 80x60, expected 64x48; ")


@pytest.mark.parametrize("content", [b"", b"no picture", b"\x89PNG\r\n\x1a\n truncated"])
def test_the_error_names_an_unreadable_frame(folder, content):
    (folder / "7.png").write_bytes(content)
    assert error(folder).startswith(f"{folder}/7.png: not readable as a picture, expected ")


def test_the_error_names_a_truncated_frame(folder):
    picture = np.random.default_rng(0).integers(0, 256, (48, 64), dtype=np.uint8)
    for kind in (".png", ".jpg"):
        whole = cv2.imencode(kind, picture)[1].tobytes()
        (folder / "7.png").write_bytes(whole)
        assert len(list(ImageFolder(folder).decode_frames())) == 12
        (folder / "7.png").write_bytes(whole[: len(whole) // 2])
        assert error(folder).startswith(f"{folder}/7.png: not readable as a picture, expected an undamaged ")


def test_the_error_names_a_frame_too_large_to_be_read(folder):
    """The frame's header claims billions of pixels."""
    header = b"IHDR" + struct.pack(">II5B", 60000, 60000, 8, 0, 0, 0, 0)
    png = cv2.imencode(".png", np.zeros((48, 64), np.uint8))[1].tobytes()
    (folder / "7.png").write_bytes(
        png[:12] + header + zlib.crc32(header).to_bytes(4) + png[12 + len(header) + 4 :]
    )
    assert error(folder).startswith(f"{folder}/7.png: not readable as a picture")


def test_colour_depth_and_transparency_do_not_matter(folder):
    for path in folder.glob("*.png"):
        path.unlink()
    for shape, kind in (((48, 64), np.uint8), ((48, 64, 4), np.uint8), ((48, 64), np.uint16)):
        cv2.imwrite(str(folder / "1.png"), np.full(shape, 90 * (257 if kind == np.uint16 else 1), kind))
        (frame,) = ImageFolder(folder).decode_frames()
        assert frame.dtype == np.uint8 and (frame == 90).all()


def test_the_error_names_a_missing_frame(folder):
    (folder / "7.png").unlink()
    assert error(folder).startswith(f"{folder}/7.png: missing, expected ")


def test_frame_numbers_can_have_larger_steps(folder):
    for path in folder.glob("*.png"):
        path.rename(folder / f"run{30 * int(path.stem):05}.png")
    assert len(ImageFolder(folder).frame_paths) == 12
    (folder / "run00120.png").unlink()
    assert f"{folder}/run00120.png: missing" in error(folder)


def test_several_sequences_follow_each_other(folder):
    for clip in ("b", "a"):
        (folder / clip).mkdir()
        for number in (1, 2, 3):
            cv2.imwrite(str(folder / clip / f"{number}.jpg"), np.zeros((48, 64), np.uint8))
    (folder / "camera.yaml").write_text(VIEW.replace("*.png", "*/*.jpg"))
    names = [str(path.relative_to(folder)) for path in ImageFolder(folder).frame_paths]
    assert names == ["a/1.jpg", "a/2.jpg", "a/3.jpg", "b/1.jpg", "b/2.jpg", "b/3.jpg"]
    for path in folder.glob("*/2.jpg"):
        path.rename(path.with_name("two.jpg"))
    assert len(ImageFolder(folder).frame_paths) == 6


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("camera/1", "camera/2", "camera.yaml:1: schema: 'camera/2', expected one of camera/1"),
        ("fps: 20", "fsp: 20", "camera.yaml:9: unknown key 'fsp'"),
        ("fps: 20\n", "", "both or none of fps, spacing_m, expected exactly one of them"),
        ("fps: 20", "fps: 20\nspacing_m: 2", "both or none of fps, spacing_m, expected exactly one of them"),
        (
            "focal_px: 60",
            "focal_px: 60\npitch_deg: 3",
            "pitch_deg, expected horizon_row, focal_px and height_m",
        ),
        ("horizon_row: 20", "horizon_row: 47", "camera.yaml:6: horizon_row: '47'"),
        ("*.png", "*.tif", "expected a pattern that matches files in"),
        ("*.png", "../*.png", "expected files in the folder or below it"),
        ("*.png", "**.png", "camera.yaml:3: files: '**.png', expected a pattern such as *.png"),
        ("width: 64", "width: 64.5", "camera.yaml:4: width: '64.5', expected a whole number of pixels"),
        ("rows: 48", "rows: many", "camera.yaml:5: rows: 'many'"),
        ("rows: 48", "rows: 48\nresize_width: 128", "resize_width: '128', expected a number from 16 to 64"),
    ],
)
def test_a_wrong_calibration_is_explained(folder, old, new, message):
    (folder / "camera.yaml").write_text(VIEW.replace(old, new))
    assert message in error(folder)


def test_a_camera_that_sees_no_road_is_refused(folder):
    (folder / "camera.yaml").write_text(CALTECH.replace("cy_px: 256.5", "cy_px: 600"))
    assert "pitch_deg: '14', expected road in the picture" in error(folder)


def test_the_error_names_a_missing_calibration(tmp_path):
    assert error(tmp_path).startswith(f"{tmp_path}/camera.yaml: No such file")


EXAMPLES = re.findall(r"```yaml\n(.*?)```", PAGE.read_text(), re.DOTALL)


@pytest.mark.parametrize("text", EXAMPLES)
def test_the_calibrations_in_the_docs_are_valid(tmp_path, text):
    (tmp_path / "camera.yaml").write_text(text)
    pattern = re.search(r'files: "([^"]*)"', text)
    frame = tmp_path / pattern[1].replace("*", "1")
    frame.parent.mkdir(exist_ok=True)
    frame.write_bytes(b"")
    model = ImageFolder(tmp_path).model
    assert model.width == 640
    assert 0.2 * model.rows < model.horizon < 0.7 * model.rows
    assert 1.4 < model.lines_divergence() < 3.2


def test_the_docs_show_a_calibration_for_each_known_data_set():
    names = " ".join(re.findall(r"name: (.*)", PAGE.read_text()))
    assert len(EXAMPLES) == 5
    assert all(name in names for name in ("caltech", "tusimple", "culane", "udacity", "my road"))
