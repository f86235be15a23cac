"""A folder of user frames, with a `camera.yaml` that describes camera and spacing."""

import re
from collections.abc import Iterator
from hashlib import sha256
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np

from selfdrive.common.camera_model import CameraModel
from selfdrive.common.conversions import DEG_TO_RAD
from selfdrive.common.errors import ConfigError
from selfdrive.sim.yaml_section import YamlSection, read_yaml

CALIBRATION_FILE = "camera.yaml"
SCHEMA = "camera/1"
_KEY_MEANINGS = {
    "schema": f"{SCHEMA!r}, the format of this file",
    "name": "the frames' name in a run's record",
    "files": 'the pattern of the frames\' file names, such as "*.png"; frames are ordered by their numbers',
    "width": "a frame's width in pixels",
    "rows": "a frame's height in pixels",
    "resize_width": "the width to which frames are reduced, if any (the height in proportion)",
    "fx_px": "the horizontal focal length",
    "fy_px": "the vertical focal length",
    "cx_px": "the column of the optical axis",
    "cy_px": "the row of the optical axis",
    "pitch_deg": "the camera's pitch, positive if it looks down",
    "horizon_row": "the row of a flat road's horizon, instead of fx_px, fy_px, cx_px, cy_px and pitch_deg",
    "focal_px": "the focal length, with `horizon_row`, if the optical axis is in the frame's middle",
    "height_m": "the height of the camera above the road",
    "fps": "the number of frames per second, if frames follow the time of a run",
    "spacing_m": "the distance between frames in metres, if frames follow the distance driven",
}
_MOST_PIXELS = 8192  # pixels
_LAST_NUMBER_PATTERN = re.compile(r"(\d+)(?!.*\d)")  # the last number in a file name


class ImageFolder:
    """The calibration and every frame's bytes; `read` decodes them.

    `model` is the camera of the decoded frames. Either `spacing` (m) or `fps` (1/s) is None.
    """

    def __init__(self, folder: Path) -> None:
        self._calibration = folder / CALIBRATION_FILE
        text, root = _load_calibration(folder)
        self.name = root.text("name")
        self._width, self._rows = _parse_frame_size(root)
        self.model = _parse_camera(root)
        if ("fps" in root) == ("spacing_m" in root):
            root.fail(
                "both or none of fps, spacing_m", "exactly one of them", f"fps is {_KEY_MEANINGS['fps']}"
            )
        self.fps = root.number("fps", 0.1, 1000.0) if "fps" in root else None
        self.spacing = None if self.fps else root.number("spacing_m", 0.01, 1000.0)
        self.frame_paths = _list_frames(folder, root)
        parts = [text, *(_read_file(file, "a frame", "put it there") for file in self.frame_paths)]
        self.digest = sha256(b"".join(sha256(part).digest() for part in parts)).hexdigest()

    def decode_frames(self) -> Iterator[np.ndarray]:
        """Yield the frames (uint8, rows x width). Raises ConfigError at the first invalid one."""
        for path in self.frame_paths:
            frame = _decode(_read_file(path, "a frame", "put it there"))
            if frame is None:
                raise ConfigError(
                    "not readable as a picture",
                    where=str(path),
                    expected="an undamaged picture, such as a PNG or JPEG file",
                    remedy="replace it",
                )
            rows, width = frame.shape
            if (width, rows) != (self._width, self._rows):
                raise ConfigError(
                    f"{width}x{rows}",
                    where=str(path),
                    expected=f"{self._width}x{self._rows}",
                    remedy=f"all frames must have the size that {self._calibration} gives",
                )
            if width != self.model.width:
                size = self.model.width, self.model.rows
                frame = cv2.resize(frame, size, interpolation=cv2.INTER_AREA)
            yield frame


def load_camera(folder: Path) -> CameraModel:
    return _parse_camera(_load_calibration(folder)[1])


def _load_calibration(folder: Path) -> tuple[bytes, YamlSection]:
    path = folder / CALIBRATION_FILE
    remedy = "write it as docs/how-to/use-your-own-frames.md says"
    text = _read_file(path, "the calibration of the frames in this folder", remedy)
    root = read_yaml(text.decode(errors="replace"), str(path), _KEY_MEANINGS)
    root.text("schema", (SCHEMA,))
    return text, root


def _parse_frame_size(root: YamlSection) -> tuple[int, int]:
    return _parse_pixels(root, "width", _MOST_PIXELS), _parse_pixels(root, "rows", _MOST_PIXELS)


def _parse_pixels(root: YamlSection, key: str, most: int) -> int:
    value = root.number(key, 16, most)
    root.check(key, value == int(value), "a whole number of pixels", f"{key} is {_KEY_MEANINGS[key]}")
    return int(value)


def _parse_camera(root: YamlSection) -> CameraModel:
    width, rows = _parse_frame_size(root)
    model = _parse_full_size_camera(root, width, rows)
    return (
        _scale_camera(model, _parse_pixels(root, "resize_width", width)) if "resize_width" in root else model
    )


def _parse_full_size_camera(root: YamlSection, width: int, rows: int) -> CameraModel:
    height = root.number("height_m", 0.2, 10.0)
    calibration_keys = ("fx_px", "fy_px", "cx_px", "cy_px", "pitch_deg")
    if "horizon_row" in root or "focal_px" in root:
        if redundant_keys := [key for key in calibration_keys if key in root]:
            root.fail(
                " and ".join(redundant_keys),
                "horizon_row, focal_px and height_m alone",
                "remove one or the other",
            )
        horizon = root.number("horizon_row", -rows, rows - 16.0)
        focal = root.number("focal_px", 16.0, _MOST_PIXELS)
        return CameraModel.from_view(width=width, rows=rows, horizon=horizon, focal=focal, height=height)
    fx, fy = (root.number(key, 16.0, _MOST_PIXELS) for key in calibration_keys[:2])
    cx, cy = (root.number(key, -_MOST_PIXELS, _MOST_PIXELS) for key in calibration_keys[2:4])
    pitch = root.number("pitch_deg", -30.0, 60.0) * DEG_TO_RAD
    model = CameraModel(width=width, rows=rows, fx=fx, fy=fy, cx=cx, cy=cy, height=height, pitch=pitch)
    sees_road = model.horizon < rows - 16.0
    root.check(
        "pitch_deg", sees_road, "road in the picture", f"the horizon would be at row {model.horizon:.0f}"
    )
    return model


def _scale_camera(model: CameraModel, width: int) -> CameraModel:
    rows = round(model.rows * width / model.width)
    across, down = width / model.width, rows / model.rows
    return CameraModel(
        width=width,
        rows=rows,
        fx=model.fx * across,
        fy=model.fy * down,
        cx=(model.cx + 0.5) * across - 0.5,
        cy=(model.cy + 0.5) * down - 0.5,
        height=model.height,
        pitch=model.pitch,
    )


def _list_frames(folder: Path, root: YamlSection) -> list[Path]:
    """The frames in order of the numbers in their names. Raises ConfigError if one is missing."""
    pattern = root.text("files")
    root.check(
        "files",
        not pattern.startswith("/") and ".." not in pattern,
        "files in the folder or below it",
        "put them there",
    )
    *folders, name = pattern.split("/")
    # Other uses of `**` differ between Python versions.
    root.check(
        "files",
        bool(name) and "**" not in name and all(part == "**" or "**" not in part for part in folders),
        "a pattern such as *.png, */*.png or **/*.png",
        "correct the pattern",
    )
    files = sorted((path for path in folder.glob(pattern) if path.is_file()), key=_sort_key)
    root.check("files", bool(files), f"a pattern that matches files in {folder}", "correct the pattern")
    for missing in _missing_frames(files):
        raise ConfigError(
            "missing",
            where=str(missing),
            expected="a frame, because frames before and after it exist",
            remedy="put it there, or renumber the frames",
        )
    return files


def _sort_key(path: Path) -> list[tuple[int, str]]:
    parts = re.split(r"(\d+)", str(path))
    return [(int(part), "") if part.isdecimal() else (-1, part) for part in parts]


def _missing_frames(files: list[Path]) -> Iterator[Path]:
    numbered: list[tuple[Path, re.Match[str], int]] = []
    for path in files:
        match = _LAST_NUMBER_PATTERN.search(path.name)
        if match is None:
            return
        numbered.append((path, match, int(match[1])))
    pairs = [
        (before, after)
        for before, after in pairwise(numbered)
        if _path_with_number(*before[:2], 0) == _path_with_number(*after[:2], 0)  # only the number differs
    ]
    step = min((after[2] - before[2] for before, after in pairs), default=1)
    for (path, match, number), after in pairs:
        if after[2] - number != step:
            yield _path_with_number(path, match, number + step)


def _path_with_number(path: Path, match: re.Match[str], number: int) -> Path:
    name, digits = path.name, len(match[1])
    return path.with_name(f"{name[: match.start()]}{number:0{digits}}{name[match.end() :]}")


def _decode(data: bytes) -> np.ndarray | None:
    # OpenCV fills in the rest of a truncated JPEG file, so check that the last scan is complete.
    if data[:2] == b"\xff\xd8" and data.rfind(b"\xff\xda") > data.rfind(b"\xff\xd9"):
        return None
    try:
        frame = cv2.imdecode(
            np.frombuffer(data, np.uint8), cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION
        )
    except cv2.error:  # an empty file, or a size beyond OpenCV's limit
        return None
    return frame


def _read_file(path: Path, expected: str, remedy: str) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise ConfigError(str(error.strerror), where=str(path), expected=expected, remedy=remedy) from None
