"""Records camera frames and the controller's view of them.

A film is a folder: `film.jsonl`, with a heading and a line for each picture, and the pictures as JPEG files.
It is written during the run, so an aborted run has a film up to that point. For stills, the pictures near
their times are enough.
"""

import json
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from selfdrive.common.camera_model import CameraModel
from selfdrive.common.errors import writing
from selfdrive.common.realtime import DT_MDL
from selfdrive.manager import Manager
from selfdrive.messages import VIEW_LENGTH, CameraView, ModelData
from selfdrive.sim.truth import GroundTruth

SCHEMA = "film/1"
INDEX_FILE = "film.jsonl"
SAMPLE_DISTANCES = tuple(range(0, VIEW_LENGTH, 7))  # m ahead, where lines are recorded
JPEG_QUALITY = 95  # high, to preserve noise from effects


@dataclass(frozen=True, slots=True, kw_only=True)
class FilmOptions:
    """Where a film is recorded. With `still_times` (s), it has only the pictures that stills at these times
    need.
    """

    folder: Path
    still_times: Sequence[float] = ()


class FilmRecorder:
    """A film being recorded. If recording fails, the run ends with ConfigError."""

    def __init__(self, options: FilmOptions, camera: CameraModel) -> None:
        self._folder = folder = options.folder
        self._still_times = options.still_times
        self._count = 0
        with self._writing():
            folder.mkdir(parents=True, exist_ok=True)
            (folder / INDEX_FILE).write_text(_json_line({"schema": SCHEMA, "camera": asdict(camera)}))

    def take(
        self, truth: GroundTruth, view: CameraView, manager: Manager, hazards: Mapping[str, float | None]
    ) -> None:
        state, radar = manager.controlsd.state, manager.radar_state
        lead = radar.lead_one if radar else None
        entry = {
            "t": truth.t,
            "position": truth.position,
            "offset": truth.lateral_offset,
            "heading": truth.heading,
            "middle": view.path_y,
            "v_ego": truth.v_ego,
            "d_rel": None if truth.free_road else truth.d_rel,
            "bend": _sample(view.bend),
            "picture": self._save_picture(view, truth.t),
            "seen": _detections_as_json(manager.visiond.latest, truth.t),
            "plan": [_polynomial_value(manager.controlsd.plan.d_poly, x) for x in SAMPLE_DISTANCES],
            "radar": lead.d_rel if lead and lead.status else None,
            "alerts": list(state.alerts),
            "text": state.alert_text1,
            "hazards": [name for name, t in hazards.items() if t is not None],
        }
        with self._writing(), (self._folder / INDEX_FILE).open("a") as file:
            file.write(_json_line(entry))
        self._count += 1

    def _save_picture(self, view: CameraView, t: float) -> str | None:
        """Return the picture's file name, also if no still needs the file."""
        if view.picture is None:
            return None
        name = f"{self._count:05d}.jpg"
        if self._still_times and all(abs(t - still) > DT_MDL for still in self._still_times):
            return name  # the picture is not even drawn
        import cv2  # not needed in runs without pictures

        data = cv2.imencode(".jpg", np.asarray(view.picture), [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])[1]
        with self._writing():
            (self._folder / name).write_bytes(data)
        return name

    def _writing(self) -> AbstractContextManager[None]:
        return writing(self._folder, expected="a writable folder", remedy="choose another --film")


def _detections_as_json(model: ModelData | None, t: float) -> dict | None:
    if model is None or model.t != t:
        return None
    lines = {"left": model.left_lane, "right": model.right_lane}
    return {
        **{name: {"y": _sample(line.points), "prob": line.prob} for name, line in lines.items()},
        "lead": model.lead.d_rel,
    }


def _polynomial_value(polynomial: Sequence[float], x: float) -> float:
    total = 0.0
    for factor in polynomial:
        total = total * x + float(factor)
    return total


def _sample(values: Sequence[float]) -> list[float]:
    return [float(values[x]) for x in SAMPLE_DISTANCES]


def _json_line(entry: dict) -> str:
    return json.dumps(entry) + "\n"
