"""Frames in which detectors are judged: each with its true lines, and the same frame without these lines.

The frame without lines shows how much of each line can still be seen through an effect: where both frames are
(almost) equal behind the effect, no detector could see the line.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from selfdrive.common.camera_model import CameraModel
from selfdrive.sim.effects.effect import Effect
from selfdrive.sim.road_renderer import RoadRenderer
from selfdrive.visiond.detector import RoadLine
from selfdrive.visiond_lab.evaluate_on_real_frames import (
    LINES_COMPARED_ROW,
    SPACING_TOLERANCE,
    UDACITY_MODEL,
    LabelledFrame,
)
from selfdrive.visiond_lab.evaluate_under_effects import EFFECT_MOMENT
from selfdrive.visiond_lab.random_looks import random_camera, random_look

NEAR, FAR = 4.9, 30.0  # m ahead, where a line's pixels are counted
LINE_LEVELS, SEEN_LEVELS = 8, 4  # grey levels by which a line's pixel differs, clean and behind an effect
MIN_LINE_PIXELS = 30  # a line with fewer is not judged
MIN_SEEN_SHARE = 0.5  # of a line's pixels
COMPARED_DISTANCE, MOST_ERROR = 10.0, 0.3  # m
ROAD_PERIODS = 4  # of 12.2 m
POSE_SIGMAS = 0.3, 0.01  # m, rad: usual offsets and headings of the car
COMMON_CAMERA_SHARE = 0.5  # of roads that the default camera and that of the real frames see
HALF_MARK_WIDTH = 0.22  # m: pixels so close to a real line are replaced
SIDES = 0, 1  # left, right


@dataclass(frozen=True, kw_only=True)
class JudgedFrame:
    """A grey frame, and the same `without_lines`.

    `columns` has the lines' columns, left and right, in the picture's `row`; a detected line is right if it
    is off by at most `tolerance` pixels.
    """

    name: str
    model: CameraModel
    picture: np.ndarray
    without_lines: np.ndarray
    row: float
    columns: tuple[float, float]
    tolerance: float
    middle: tuple[float, float]  # a, b: left of column = a * row + b is the left line

    def is_right(self, side: int, line: RoadLine) -> bool:
        a, b = self.model.line_in_picture(line.y, line.slope)
        return abs(a * self.row + b - self.columns[side]) <= self.tolerance

    def measure_seen_shares(self, affected: np.ndarray, affected_without_lines: np.ndarray) -> list[float]:
        """Return the share of each line's pixels that are seen behind an effect; NaN for a line that is not
        judged.
        """
        difference = np.abs(affected[self._rows].astype(np.int16) - affected_without_lines[self._rows])
        is_seen = difference >= SEEN_LEVELS
        return [
            float(is_seen[pixels].mean()) if pixels.sum() >= MIN_LINE_PIXELS else float("nan")
            for pixels in self._line_pixels
        ]

    @cached_property
    def _rows(self) -> slice:
        model = self.model
        return slice(int(np.ceil(model.row(FAR))), min(model.rows, int(model.row(NEAR))))

    @cached_property
    def _line_pixels(self) -> tuple[np.ndarray, np.ndarray]:
        rows = self._rows
        difference = np.abs(self.picture[rows].astype(np.int16) - self.without_lines[rows])
        painted = difference >= LINE_LEVELS
        row = np.arange(rows.start, rows.stop)[:, None]
        is_left = np.arange(self.model.width) < self.middle[0] * row + self.middle[1]
        return painted & is_left, painted & ~is_left


def affect_frame(frame: JudgedFrame, kind: type[Effect], amount: float, seed: int) -> np.ndarray:
    return np.asarray(kind(amount, seed, frame.model).apply(frame.picture, EFFECT_MOMENT))


def measure_seen_shares_behind_effect(
    frame: JudgedFrame, kind: type[Effect], amount: float, seed: int
) -> list[float]:
    """Return the share of each line's pixels that are seen behind an effect."""
    bare = replace(frame, picture=frame.without_lines)
    return frame.measure_seen_shares(
        affect_frame(frame, kind, amount, seed), affect_frame(bare, kind, amount, seed)
    )


def render_frames(
    count: int, seed: Sequence[int], pose_sigmas: tuple[float, float] = POSE_SIGMAS
) -> Iterator[JudgedFrame]:
    """Frames of `count` different roads; equal seeds give equal frames."""
    for number in range(count):
        rng = np.random.default_rng([*seed, number])
        look, model = random_look(rng), _draw_camera(rng)
        road_seed = int(rng.integers(2**31))
        bare = replace(look, left=replace(look.left, fade=1.0), right=replace(look.right, fade=1.0))
        pose = rng.uniform(0.0, 40.0), *rng.normal(0.0, pose_sigmas).tolist()
        roads = [RoadRenderer(model, paints, road_seed, periods=ROAD_PERIODS) for paints in (look, bare)]
        picture, without_lines = (road.render_grey(*pose) for road in roads)
        lines = [model.line_in_picture(*line) for line in roads[0].true_lines(*pose[1:])]
        row = model.row(COMPARED_DISTANCE)
        left, right = (a * row + b for a, b in lines)
        yield JudgedFrame(
            name=f"road {number}",
            model=model,
            picture=picture,
            without_lines=without_lines,
            row=row,
            columns=(left, right),
            tolerance=MOST_ERROR / model.metres_per_pixel(row),
            middle=_middle(*lines),
        )


def _draw_camera(rng: np.random.Generator) -> CameraModel:
    camera = random_camera(rng)
    if rng.random() < COMMON_CAMERA_SHARE:
        return CameraModel() if rng.random() < 0.5 else UDACITY_MODEL
    return camera


def judged_real_frame(frame: LabelledFrame) -> JudgedFrame:
    """A real frame with straight true lines: pixels beside each line replace it in `without_lines`."""
    picture, model = frame.grey, frame.model
    columns = frame.left_column, frame.right_column
    lines = [(a, at - a * LINES_COMPARED_ROW) for a, at in zip(frame.slopes, columns, strict=True)]
    without_lines, column = picture.copy(), np.arange(model.width)
    for row in range(int(model.row(FAR)), min(model.rows, int(model.row(NEAR)))):
        half = HALF_MARK_WIDTH / model.metres_per_pixel(row)
        for a, b in lines:
            near = np.abs(column - (a * row + b)) <= half
            if near.any():
                without_lines[row, near] = np.interp(column[near], column[~near], picture[row, ~near])
    return JudgedFrame(
        name=frame.key,
        model=model,
        picture=picture,
        without_lines=without_lines,
        row=LINES_COMPARED_ROW,
        columns=columns,
        tolerance=SPACING_TOLERANCE * (frame.right_column - frame.left_column),
        middle=_middle(*lines),
    )


def _middle(left: tuple[float, float], right: tuple[float, float]) -> tuple[float, float]:
    return 0.5 * (left[0] + right[0]), 0.5 * (left[1] + right[1])
