"""Measures how well a detector finds real lanes: `python -m selfdrive.visiond_lab.evaluate FRAMES TRUTH`.

TRUTH is a JSON file: {"lines": {KEY: {"L": [a, b], "R": [a, b]}}} with x = a * row + b, or, if only the
lines' centres in row 278 are known, {KEY: {"gt": [xl, xr]}}. Coordinates are in the canonical frame: 640 x
480, the frame scaled to 640 and moved vertically until its vanishing row is 200. The first word of a key
(`p1` in `p1_solidWhiteCurve`) names the camera, unless FRAMES has a camera.yaml.
"""

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from math import tan
from pathlib import Path

import cv2
import numpy as np

from selfdrive.common.camera_model import CameraModel
from selfdrive.common.errors import ConfigError, writing
from selfdrive.messages import CameraView
from selfdrive.sim.image_folder import CALIBRATION, camera_of
from selfdrive.visiond.detector import LaneDetector, LaneLines
from selfdrive.visiond.paper_detector import PaperDetector
from selfdrive.visiond.robust_detector import RobustDetector

EXIT_INVALID_INPUT = 2
WIDTH, ROWS, HORIZON = 640, 480, 200  # of the canonical frame
ROW = 278  # where lines are compared
TOLERANCE = 0.3 / 3.7  # of the lines' true spacing
IMAGES = (".jpg", ".png", ".jpeg")
ROBUST, PAPER, BOTH = "robust", "paper", "both"
GREEN, RED = (0, 255, 0), (0, 0, 255)


@dataclass(frozen=True, slots=True, kw_only=True)
class Source:
    """A camera: the row of `rows` where straight roads vanish, and its canonical model."""

    vanishing_row: float
    rows: int
    model: CameraModel


def _canonical_model(focal: float, height: float) -> CameraModel:
    return CameraModel.from_view(width=WIDTH, rows=ROWS, horizon=HORIZON, focal=focal, height=height)


UDACITY = _canonical_model(focal=579.0, height=1.21)  # lines 3.7 m apart diverge by 3.05 px per row
TUSIMPLE = _canonical_model(focal=500.0, height=1.68)  # 2.2 px per row
SOURCES = {
    "p1": Source(vanishing_row=318, rows=540, model=UDACITY),
    "vid": Source(vanishing_row=318, rows=540, model=UDACITY),
    "adv": Source(vanishing_row=425, rows=720, model=UDACITY),
    "tus": Source(vanishing_row=238, rows=720, model=TUSIMPLE),
    "tust": Source(vanishing_row=238, rows=720, model=TUSIMPLE),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Frame:
    """A frame to examine, in colour in the canonical frame, and its lines' true columns in row 278."""

    key: str
    colour: np.ndarray
    model: CameraModel
    left: float
    right: float

    @property
    def grey(self) -> np.ndarray:
        return cv2.cvtColor(self.colour, cv2.COLOR_BGR2GRAY)


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """A detector's result for a frame: errors (px, right positive) in row 278, None for a line not found."""

    frame: Frame
    lines: LaneLines
    left: float | None
    right: float | None

    @property
    def good(self) -> bool:
        limit = TOLERANCE * (self.frame.right - self.frame.left)
        return all(error is not None and abs(error) <= limit for error in (self.left, self.right))


def canonical(colour: np.ndarray, source: Source) -> np.ndarray:
    """The frame scaled to 640 and moved so that its vanishing row is 200, padded with black to 640 x 480."""
    rows, width = colour.shape[:2]
    scale = WIDTH / width
    small = cv2.resize(colour, (WIDTH, round(rows * scale)), interpolation=cv2.INTER_AREA)
    down = HORIZON - source.vanishing_row * (rows / source.rows) * scale
    return cv2.warpAffine(small, np.float32([[1, 0, 0], [0, 1, down]]), (WIDTH, ROWS))


def read_frames(folder: Path, truth: Path) -> list[Frame]:
    """Read the frames that the truth file names. Raises ConfigError if one is missing or unreadable."""
    images = [path for path in sorted(folder.rglob("*")) if path.suffix.lower() in IMAGES]
    own = _source_of(camera_of(folder)) if (folder / CALIBRATION).exists() else None
    frames = []
    for key, entry in _read_truth(truth).items():
        source = own or SOURCES.get(key.partition("_")[0])
        if source is None:
            raise ConfigError(
                f"no camera for {key!r}",
                where=str(truth),
                expected=f"a key that starts with one of {', '.join(SOURCES)}",
                remedy=f"rename it, or add a {CALIBRATION} to the frames",
            )
        left, right = _centres(key, entry, truth)
        path = _image(key, images, folder)
        colour = cv2.imread(str(path), cv2.IMREAD_COLOR)
        if colour is None:
            raise ConfigError(
                "unreadable image", where=str(path), expected="a JPEG or PNG file", remedy="replace it"
            )
        frames.append(
            Frame(key=key, colour=canonical(colour, source), model=source.model, left=left, right=right)
        )
    return frames


def evaluate(detector: str, frames: list[Frame]) -> list[Finding]:
    return [look(build(detector, frame.model), frame, frame.grey) for frame in frames]


def look(detector: LaneDetector, frame: Frame, picture: np.ndarray) -> Finding:
    view = CameraView(left_lane_y=0.0, right_lane_y=0.0, path_y=0.0, bend=(), lead_d_rel=0.0, picture=picture)
    lines = detector.detect(view)
    errors = []
    for line, true in ((lines.left, frame.left), (lines.right, frame.right)):
        a, b = frame.model.line_in_picture(line.y, line.slope)
        errors.append(a * ROW + b - true if line.prob > 0.0 else None)
    return Finding(frame=frame, lines=lines, left=errors[0], right=errors[1])


def build(name: str, model: CameraModel) -> PaperDetector | RobustDetector:
    return PaperDetector(model) if name == PAPER else RobustDetector(model)


def report(detector: str, findings: list[Finding]) -> str:
    rows = [f"{detector}: errors in row {ROW} (px), limit {TOLERANCE:.4f} of the spacing"]
    for finding in findings:
        frame = finding.frame
        errors = "  ".join(
            f"{side} {'not found' if error is None else f'{error:+9.1f}':>9}"
            for side, error in (("left", finding.left), ("right", finding.right))
        )
        limit = TOLERANCE * (frame.right - frame.left)
        rows.append(f"  {frame.key:32} {errors}  limit {limit:5.1f}  {'ok' if finding.good else 'MISSED'}")
    good = sum(finding.good for finding in findings)
    rows.append(f"{detector}: both lines found in {good} of {len(findings)} = {good / len(findings):.1%}")
    return "\n".join(rows)


def draw(finding: Finding) -> np.ndarray:
    canvas, frame = finding.frame.colour.copy(), finding.frame
    for line in (finding.lines.left, finding.lines.right):
        if line.prob > 0.0:
            a, b = frame.model.line_in_picture(line.y, line.slope)
            ends = [(round(a * row + b), row) for row in (HORIZON + 15, ROWS - 1)]
            cv2.line(canvas, *ends, GREEN, 1, cv2.LINE_AA)
    for column in (frame.left, frame.right):
        cv2.circle(canvas, (round(column), ROW), 4, RED, 1, cv2.LINE_AA)
    return canvas


def main(arguments: Sequence[str] | None = None) -> int:
    options = _parse_arguments(arguments)
    cv2.setNumThreads(1)
    try:
        frames = read_frames(options.frames, options.truth)
        for detector in (PAPER, ROBUST) if options.detector == BOTH else (options.detector,):
            findings = evaluate(detector, frames)
            print(report(detector, findings))
            if options.overlays:
                _write_overlays(options.overlays, detector, findings)
    except ConfigError as error:
        print(f"error: {error}", file=sys.stderr)
        return EXIT_INVALID_INPUT
    return 0


def _source_of(model: CameraModel) -> Source:
    scale = WIDTH / model.width
    fy = model.fy * scale
    seen = CameraModel(
        width=WIDTH,
        rows=ROWS,
        fx=model.fx * scale,
        fy=fy,
        cx=(model.cx + 0.5) * scale - 0.5,
        cy=HORIZON + fy * tan(model.pitch),
        height=model.height,
        pitch=model.pitch,
    )
    return Source(vanishing_row=model.horizon, rows=model.rows, model=seen)


def _read_truth(path: Path) -> dict:
    try:
        lines = json.loads(path.read_text(encoding="utf-8"))["lines"]
    except OSError as error:
        got = str(error.strerror)
    except (ValueError, KeyError, TypeError) as error:
        got = f"no table of lines ({type(error).__name__}: {error})"
    else:
        if isinstance(lines, dict) and lines:
            return lines
        got = "no lines"
    raise ConfigError(
        got, where=str(path), expected='JSON with {"lines": {KEY: ...}}', remedy="give a truth file"
    )


def _centres(key: str, entry: dict, truth: Path) -> tuple[float, float]:
    try:
        if entry.get("L") and entry.get("R"):
            left, right = (entry[side][0] * ROW + entry[side][1] for side in "LR")
        else:
            centres = entry["gt"]
            left, right = (centres[side] for side in ("LR" if isinstance(centres, dict) else (0, 1)))
        left, right = float(left), float(right)
    except (AttributeError, KeyError, IndexError, TypeError, ValueError):
        left, right = 0.0, 0.0
    if left < right:
        return left, right
    raise ConfigError(
        f"{key}: {entry!r}",
        where=str(truth),
        expected='{"L": [a, b], "R": [a, b]} or {"gt": [xl, xr]} with the left line left of the right one',
        remedy="correct the entry",
    )


def _image(key: str, images: list[Path], folder: Path) -> Path:
    """The key's file: `KEY.jpg`, or without the key's first word. Raises ConfigError if it is missing.

    Of several files, the one in a folder named after the key's first word is used.
    """
    camera, _, name = key.partition("_")
    named = [path for path in images if path.stem == key] or [path for path in images if path.stem == name]
    if len(named) > 1:
        named = [path for path in named if camera in path.relative_to(folder).parts]
    if len(named) == 1:
        return named[0]
    raise ConfigError(
        f"{'more than one' if named else 'no'} frame {key!r}",
        where=str(folder),
        expected=f"one {key}.jpg or {name}.jpg (or .png, .jpeg) in the folder or below it, or in {camera}/",
        remedy="leave one such file there, or remove the key from the truth file",
    )


def _write_overlays(folder: Path, detector: str, findings: list[Finding]) -> None:
    for finding in findings:
        path = folder / f"{detector}_{finding.frame.key}.png"
        with writing(path, expected="a writable folder", remedy="choose another --overlays"):
            folder.mkdir(parents=True, exist_ok=True)
            path.write_bytes(cv2.imencode(".png", draw(finding))[1])


def _parse_arguments(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="selfdrive.visiond_lab.evaluate",
        description="Compare detected lanes of real frames with the truth.",
    )
    parser.add_argument("frames", type=Path, metavar="FRAMES", help="folder of frames")
    parser.add_argument("truth", type=Path, metavar="TRUTH", help="JSON file with the true lines")
    parser.add_argument("--detector", choices=(PAPER, ROBUST, BOTH), default=BOTH, help="what to measure")
    parser.add_argument("--overlays", type=Path, metavar="DIR", help="write frames with found lines here")
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main())
