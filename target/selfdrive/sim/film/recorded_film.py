"""Reads a run's film."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
from pathlib import Path

import cv2
import numpy as np

from selfdrive.common.camera_model import CameraModel
from selfdrive.common.errors import ConfigError
from selfdrive.sim.film.film_recorder import INDEX_FILE, SCHEMA


@dataclass(frozen=True, slots=True, kw_only=True)
class DetectedLine:
    """A line as visiond published it: `y` (m, left positive) at SAMPLE_DISTANCES."""

    y: Sequence[float]
    prob: float

    @property
    def is_drawable(self) -> bool:
        """Whether the line was seen and is finite; faults can produce any numbers."""
        return self.prob > 0.0 and isfinite(self.prob) and all(isfinite(y) for y in self.y)


@dataclass(frozen=True, slots=True, kw_only=True)
class FilmFrame:
    """The moment of one picture: the world, the controller's view and its messages to the driver. SI units.

    `d_rel` is None on a free road, `lines` if visiond published nothing, `radar` if radard has no lead.
    `plan` is the planned path, `bend` the shift of the lane centre, both as y at SAMPLE_DISTANCES. In the
    camera's view, the lane centre is at `middle` beside the car.
    """

    t: float
    position: float
    offset: float
    heading: float
    middle: float
    v_ego: float
    d_rel: float | None
    bend: Sequence[float]
    picture: Path | None
    lines: dict[str, DetectedLine] | None  # left, right
    plan: Sequence[float]
    camera_lead: float | None
    radar: float | None
    alerts: tuple[str, ...]
    text: str
    hazards: tuple[str, ...]

    def load_picture(self) -> np.ndarray | None:
        """The grey picture; None if the run has none. Raises ConfigError if it cannot be read."""
        if self.picture is None:
            return None
        image = cv2.imread(str(self.picture), cv2.IMREAD_GRAYSCALE)
        if image is None:
            raise ConfigError(
                "unreadable", where=str(self.picture), expected="a JPEG file", remedy="record the film again"
            )
        return image


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordedFilm:
    """A film: its camera and its frames, 50 ms apart."""

    camera: CameraModel
    frames: tuple[FilmFrame, ...]

    def frame_at(self, index: int) -> FilmFrame:
        return self.frames[min(index, len(self.frames) - 1)]


def load_film(folder: Path) -> RecordedFilm:
    """Read the film in `folder`. Raises ConfigError if it is missing or damaged."""
    index = folder / INDEX_FILE
    try:
        head, *lines = [json.loads(line) for line in index.read_text().splitlines()]
        if head["schema"] != SCHEMA or not lines:
            raise ValueError(f"schema {head['schema']}, {len(lines)} pictures")
        frames = tuple(_parse_frame(line, folder) for line in lines)
        return RecordedFilm(camera=CameraModel(**head["camera"]), frames=frames)
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise ConfigError(
            f"unreadable ({error})",
            where=str(index),
            expected=f"a {SCHEMA} file",
            remedy="record the film again",
        ) from None


def _parse_frame(entry: dict, folder: Path) -> FilmFrame:
    detections, picture = entry.pop("seen"), entry.pop("picture")
    entry["alerts"], entry["hazards"] = tuple(entry["alerts"]), tuple(entry["hazards"])
    return FilmFrame(
        **entry,
        picture=folder / picture if picture else None,
        lines={name: DetectedLine(**detections[name]) for name in ("left", "right")} if detections else None,
        camera_lead=detections["lead"] if detections else None,
    )
