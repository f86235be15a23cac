"""Measures how well a detector finds real lanes.

Run it as `python -m selfdrive.visiond_lab.evaluate_on_real_frames FRAMES TRUTH`. TRUTH is a JSON file:
{"lines": {KEY: {"L": [a, b], "R": [a, b]}}} with x = a * row + b, or, if only the lines' centres in row 278
are known, {KEY: {"gt": [xl, xr]}}. Coordinates are in the canonical frame: 640 x 480, the frame scaled to 640
and moved vertically until its vanishing row is 200. The first word of a key (`p1` in `p1_solidWhiteCurve`)
names the camera, unless FRAMES has a camera.yaml.
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
from selfdrive.sim.image_folder import CALIBRATION_FILE, load_camera
from selfdrive.visiond.detector import LaneDetector, LaneLines
from selfdrive.visiond.paper_detector import PaperDetector
from selfdrive.visiond.robust_detector import RobustDetector

EXIT_INVALID_INPUT = 2
CANONICAL_WIDTH, CANONICAL_ROWS, CANONICAL_HORIZON = 640, 480, 200  # of the canonical frame
LINES_COMPARED_ROW = 278  # where lines are compared
SPACING_TOLERANCE = 0.3 / 3.7  # of the lines' true spacing
IMAGE_SUFFIXES = (".jpg", ".png", ".jpeg")
ROBUST, PAPER, BOTH = "robust", "paper", "both"
DETECTED_COLOUR, TRUE_COLOUR = (0, 255, 0), (0, 0, 255)  # BGR


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraSource:
    """A camera: the row of `rows` where straight roads vanish, and its canonical model."""

    vanishing_row: float
    rows: int
    model: CameraModel


def _canonical_model(focal: float, height: float) -> CameraModel:
    return CameraModel.from_view(
        width=CANONICAL_WIDTH, rows=CANONICAL_ROWS, horizon=CANONICAL_HORIZON, focal=focal, height=height
    )


UDACITY_MODEL = _canonical_model(focal=579.0, height=1.21)  # lines 3.7 m apart diverge by 3.05 px per row
TUSIMPLE_MODEL = _canonical_model(focal=500.0, height=1.68)  # 2.2 px per row
# By the first word of a key, the cameras of public data sets.
SOURCE_BY_KEY = {
    "p1": CameraSource(vanishing_row=318, rows=540, model=UDACITY_MODEL),
    "vid": CameraSource(vanishing_row=318, rows=540, model=UDACITY_MODEL),
    "adv": CameraSource(vanishing_row=425, rows=720, model=UDACITY_MODEL),
    "tus": CameraSource(vanishing_row=238, rows=720, model=TUSIMPLE_MODEL),
    "tust": CameraSource(vanishing_row=238, rows=720, model=TUSIMPLE_MODEL),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class LabelledFrame:
    """A frame to examine, in colour in the canonical frame, and its lines' true columns in row 278."""

    key: str
    colour: np.ndarray
    model: CameraModel
    left_column: float
    right_column: float
    slopes: tuple[float, float]  # columns per row by which each line moves to the right

    @property
    def grey(self) -> np.ndarray:
        return cv2.cvtColor(self.colour, cv2.COLOR_BGR2GRAY)


@dataclass(frozen=True, slots=True, kw_only=True)
class DetectionResult:
    """A detector's result for a frame: errors (px, right positive) in row 278, None for a line not found."""

    frame: LabelledFrame
    lines: LaneLines
    left_error: float | None
    right_error: float | None

    @property
    def has_both_lines(self) -> bool:
        limit = SPACING_TOLERANCE * (self.frame.right_column - self.frame.left_column)
        return all(error is not None and abs(error) <= limit for error in (self.left_error, self.right_error))


def to_canonical_frame(colour: np.ndarray, source: CameraSource) -> np.ndarray:
    """The frame scaled to 640 and moved so that its vanishing row is 200, padded with black to 640 x 480."""
    rows, width = colour.shape[:2]
    scale = CANONICAL_WIDTH / width
    small = cv2.resize(colour, (CANONICAL_WIDTH, round(rows * scale)), interpolation=cv2.INTER_AREA)
    down = CANONICAL_HORIZON - source.vanishing_row * (rows / source.rows) * scale
    return cv2.warpAffine(small, np.float32([[1, 0, 0], [0, 1, down]]), (CANONICAL_WIDTH, CANONICAL_ROWS))


def load_labelled_frames(folder: Path, truth: Path) -> list[LabelledFrame]:
    """Read the frames that the truth file names. Raises ConfigError if one is missing or unreadable."""
    images = [path for path in sorted(folder.rglob("*")) if path.suffix.lower() in IMAGE_SUFFIXES]
    folder_source = _source_from_model(load_camera(folder)) if (folder / CALIBRATION_FILE).exists() else None
    frames = []
    for key, entry in _load_truth(truth).items():
        source = folder_source or SOURCE_BY_KEY.get(key.partition("_")[0])
        if source is None:
            raise ConfigError(
                f"no camera for {key!r}",
                where=str(truth),
                expected=f"a key that starts with one of {', '.join(SOURCE_BY_KEY)}",
                remedy=f"rename it, or add a {CALIBRATION_FILE} to the frames",
            )
        left, right = _true_columns(key, entry, truth)
        rows = LINES_COMPARED_ROW - CANONICAL_HORIZON  # below the vanishing point, for lines without slopes
        path = _image_of_key(key, images, folder)
        colour = cv2.imread(str(path), cv2.IMREAD_COLOR)
        if colour is None:
            raise ConfigError(
                "unreadable image", where=str(path), expected="a JPEG or PNG file", remedy="replace it"
            )
        frames.append(
            LabelledFrame(
                key=key,
                colour=to_canonical_frame(colour, source),
                model=source.model,
                left_column=left,
                right_column=right,
                slopes=tuple(
                    entry[side][0] if entry.get(side) else (column - source.model.cx) / rows
                    for side, column in (("L", left), ("R", right))
                ),
            )
        )
    return frames


def evaluate_detector(detector: str, frames: list[LabelledFrame]) -> list[DetectionResult]:
    return [detect_lines(build_lane_detector(detector, frame.model), frame, frame.grey) for frame in frames]


def detect_lines(detector: LaneDetector, frame: LabelledFrame, picture: np.ndarray) -> DetectionResult:
    view = CameraView(left_lane_y=0.0, right_lane_y=0.0, path_y=0.0, bend=(), lead_d_rel=0.0, picture=picture)
    lines = detector.detect(view)
    errors = []
    for line, true in ((lines.left, frame.left_column), (lines.right, frame.right_column)):
        a, b = frame.model.line_in_picture(line.y, line.slope)
        errors.append(a * LINES_COMPARED_ROW + b - true if line.prob > 0.0 else None)
    return DetectionResult(frame=frame, lines=lines, left_error=errors[0], right_error=errors[1])


def build_lane_detector(name: str, model: CameraModel) -> PaperDetector | RobustDetector:
    return PaperDetector(model) if name == PAPER else RobustDetector(model)


def render_report(detector: str, results: list[DetectionResult]) -> str:
    rows = [
        f"{detector}: errors in row {LINES_COMPARED_ROW} (px), limit {SPACING_TOLERANCE:.4f} of the spacing"
    ]
    for finding in results:
        frame = finding.frame
        errors = "  ".join(
            f"{side} {'not found' if error is None else f'{error:+9.1f}':>9}"
            for side, error in (("left", finding.left_error), ("right", finding.right_error))
        )
        limit = SPACING_TOLERANCE * (frame.right_column - frame.left_column)
        rows.append(
            f"  {frame.key:32} {errors}  limit {limit:5.1f}  {'ok' if finding.has_both_lines else 'MISSED'}"
        )
    good = sum(finding.has_both_lines for finding in results)
    rows.append(f"{detector}: both lines found in {good} of {len(results)} = {good / len(results):.1%}")
    return "\n".join(rows)


def draw_overlay(result: DetectionResult) -> np.ndarray:
    canvas, frame = result.frame.colour.copy(), result.frame
    for line in (result.lines.left, result.lines.right):
        if line.prob > 0.0:
            a, b = frame.model.line_in_picture(line.y, line.slope)
            ends = [(round(a * row + b), row) for row in (CANONICAL_HORIZON + 15, CANONICAL_ROWS - 1)]
            cv2.line(canvas, *ends, DETECTED_COLOUR, 1, cv2.LINE_AA)
    for column in (frame.left_column, frame.right_column):
        cv2.circle(canvas, (round(column), LINES_COMPARED_ROW), 4, TRUE_COLOUR, 1, cv2.LINE_AA)
    return canvas


def main(arguments: Sequence[str] | None = None) -> int:
    options = _parse_arguments(arguments)
    cv2.setNumThreads(1)
    try:
        frames = load_labelled_frames(options.frames, options.truth)
        for detector in (PAPER, ROBUST) if options.detector == BOTH else (options.detector,):
            findings = evaluate_detector(detector, frames)
            print(render_report(detector, findings))
            if options.overlays:
                _write_overlays(options.overlays, detector, findings)
    except ConfigError as error:
        print(f"error: {error}", file=sys.stderr)
        return EXIT_INVALID_INPUT
    return 0


def _source_from_model(model: CameraModel) -> CameraSource:
    scale = CANONICAL_WIDTH / model.width
    fy = model.fy * scale
    canonical_model = CameraModel(
        width=CANONICAL_WIDTH,
        rows=CANONICAL_ROWS,
        fx=model.fx * scale,
        fy=fy,
        cx=(model.cx + 0.5) * scale - 0.5,
        cy=CANONICAL_HORIZON + fy * tan(model.pitch),
        height=model.height,
        pitch=model.pitch,
    )
    return CameraSource(vanishing_row=model.horizon, rows=model.rows, model=canonical_model)


def _load_truth(path: Path) -> dict:
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


def _true_columns(key: str, entry: dict, truth: Path) -> tuple[float, float]:
    try:
        if entry.get("L") and entry.get("R"):
            left, right = (entry[side][0] * LINES_COMPARED_ROW + entry[side][1] for side in "LR")
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


def _image_of_key(key: str, images: list[Path], folder: Path) -> Path:
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


def _write_overlays(folder: Path, detector: str, results: list[DetectionResult]) -> None:
    for finding in results:
        path = folder / f"{detector}_{finding.frame.key}.png"
        with writing(path, expected="a writable folder", remedy="choose another --overlays"):
            folder.mkdir(parents=True, exist_ok=True)
            path.write_bytes(cv2.imencode(".png", draw_overlay(finding))[1])


def positive_number(text: str) -> int:
    """Return a count that a command line gives; ArgumentTypeError if it is none."""
    if not text.isdecimal() or int(text) == 0:
        raise argparse.ArgumentTypeError(f"'{text}' is not a whole number of 1 or more")
    return int(text)


def _parse_arguments(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="selfdrive.visiond_lab.evaluate_on_real_frames",
        description="Compare detected lanes of real frames with the truth.",
    )
    parser.add_argument("frames", type=Path, metavar="FRAMES", help="folder of frames")
    parser.add_argument("truth", type=Path, metavar="TRUTH", help="JSON file with the true lines")
    parser.add_argument("--detector", choices=(PAPER, ROBUST, BOTH), default=BOTH, help="what to measure")
    parser.add_argument("--overlays", type=Path, metavar="DIR", help="write frames with found lines here")
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main())
