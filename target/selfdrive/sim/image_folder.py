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
from selfdrive.sim.yaml_section import Section, read_yaml

CALIBRATION = "camera.yaml"
SCHEMA = "camera/1"
_KEYS = {
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
_LARGEST = 8192  # pixels
_NUMBER = re.compile(r"(\d+)(?!.*\d)")  # the last number in a file name


class ImageFolder:
    """The calibration and every frame's bytes; `read` decodes them.

    `model` is the camera of the decoded frames. Either `spacing` (m) or `fps` (1/s) is None.
    """

    def __init__(self, folder: Path) -> None:
        self._calibration = folder / CALIBRATION
        text, root = _calibration(folder)
        self.name = root.text("name")
        self._width, self._rows = _size(root)
        self.model = _camera(root)
        if ("fps" in root) == ("spacing_m" in root):
            root.fail("both or none of fps, spacing_m", "exactly one of them", f"fps is {_KEYS['fps']}")
        self.fps = root.number("fps", 0.1, 1000.0) if "fps" in root else None
        self.spacing = None if self.fps else root.number("spacing_m", 0.01, 1000.0)
        self.files = _listed(folder, root)
        parts = [text, *(_bytes(file, "a frame", "put it there") for file in self.files)]
        self.digest = sha256(b"".join(sha256(part).digest() for part in parts)).hexdigest()

    def read(self) -> Iterator[np.ndarray]:
        """Yield the frames (uint8, rows x width). Raises ConfigError at the first invalid one."""
        for path in self.files:
            frame = _decoded(_bytes(path, "a frame", "put it there"))
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


def camera_of(folder: Path) -> CameraModel:
    return _camera(_calibration(folder)[1])


def _calibration(folder: Path) -> tuple[bytes, Section]:
    path = folder / CALIBRATION
    remedy = "write it as docs/how-to/use-your-own-frames.md says"
    text = _bytes(path, "the calibration of the frames in this folder", remedy)
    root = read_yaml(text.decode(errors="replace"), str(path), _KEYS)
    root.text("schema", (SCHEMA,))
    return text, root


def _size(root: Section) -> tuple[int, int]:
    return _pixels(root, "width", _LARGEST), _pixels(root, "rows", _LARGEST)


def _pixels(root: Section, key: str, most: int) -> int:
    value = root.number(key, 16, most)
    root.check(key, value == int(value), "a whole number of pixels", f"{key} is {_KEYS[key]}")
    return int(value)


def _camera(root: Section) -> CameraModel:
    width, rows = _size(root)
    model = _model(root, width, rows)
    return _resized(model, _pixels(root, "resize_width", width)) if "resize_width" in root else model


def _model(root: Section, width: int, rows: int) -> CameraModel:
    height = root.number("height_m", 0.2, 10.0)
    whole = ("fx_px", "fy_px", "cx_px", "cy_px", "pitch_deg")
    if "horizon_row" in root or "focal_px" in root:
        if given := [key for key in whole if key in root]:
            root.fail(
                " and ".join(given), "horizon_row, focal_px and height_m alone", "remove one or the other"
            )
        horizon = root.number("horizon_row", -rows, rows - 16.0)
        focal = root.number("focal_px", 16.0, _LARGEST)
        return CameraModel.from_view(width=width, rows=rows, horizon=horizon, focal=focal, height=height)
    fx, fy = (root.number(key, 16.0, _LARGEST) for key in whole[:2])
    cx, cy = (root.number(key, -_LARGEST, _LARGEST) for key in whole[2:4])
    pitch = root.number("pitch_deg", -30.0, 60.0) * DEG_TO_RAD
    model = CameraModel(width=width, rows=rows, fx=fx, fy=fy, cx=cx, cy=cy, height=height, pitch=pitch)
    good = model.horizon < rows - 16.0
    root.check("pitch_deg", good, "road in the picture", f"the horizon would be at row {model.horizon:.0f}")
    return model


def _resized(model: CameraModel, width: int) -> CameraModel:
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


def _listed(folder: Path, root: Section) -> list[Path]:
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
    files = sorted((path for path in folder.glob(pattern) if path.is_file()), key=_order)
    root.check("files", bool(files), f"a pattern that matches files in {folder}", "correct the pattern")
    for missing in _gaps(files):
        raise ConfigError(
            "missing",
            where=str(missing),
            expected="a frame, because frames before and after it exist",
            remedy="put it there, or renumber the frames",
        )
    return files


def _order(path: Path) -> list[tuple[int, str]]:
    parts = re.split(r"(\d+)", str(path))
    return [(int(part), "") if part.isdecimal() else (-1, part) for part in parts]


def _gaps(files: list[Path]) -> Iterator[Path]:
    numbered: list[tuple[Path, re.Match[str], int]] = []
    for path in files:
        match = _NUMBER.search(path.name)
        if match is None:
            return
        numbered.append((path, match, int(match[1])))
    pairs = [
        (before, after)
        for before, after in pairwise(numbered)
        if _frame(*before[:2], 0) == _frame(*after[:2], 0)  # only the number differs
    ]
    step = min((after[2] - before[2] for before, after in pairs), default=1)
    for (path, match, number), after in pairs:
        if after[2] - number != step:
            yield _frame(path, match, number + step)


def _frame(path: Path, match: re.Match[str], number: int) -> Path:
    name, digits = path.name, len(match[1])
    return path.with_name(f"{name[: match.start()]}{number:0{digits}}{name[match.end() :]}")


def _decoded(data: bytes) -> np.ndarray | None:
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


def _bytes(path: Path, expected: str, remedy: str) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise ConfigError(str(error.strerror), where=str(path), expected=expected, remedy=remedy) from None
