"""Digests of frames, detections and traces, on which all results depend.

`python tests/differential/arithmetic.py [FOLDER]` prints them as JSON for the current Python and
processor, with the compiled code in FOLDER if given.
"""

import json
import sys
from collections.abc import Iterator
from dataclasses import replace
from hashlib import sha256
from pathlib import Path

import numpy as np
from selfdrive.common import compiled
from selfdrive.common.camera_model import CameraModel
from selfdrive.messages import CameraView
from selfdrive.sim import camera_and_detector
from selfdrive.sim.effects.effect import Moment
from selfdrive.sim.effects.levels import AMOUNTS_BY_EFFECT
from selfdrive.sim.moved_picture import AuthorsCodeShiftMover, HomographyMover, ShiftMover
from selfdrive.sim.picture import Picture
from selfdrive.sim.picture_options import (
    AUTHORS_CODE_DETECTOR,
    AUTHORS_CODE_TRANSLATION,
    DASHED_MARKS,
    DETECTORS,
    PictureOptions,
)
from selfdrive.sim.road_look import LinePaint, RoadLook
from selfdrive.sim.road_renderer import RoadRenderer
from selfdrive.sim.run import simulate
from selfdrive.sim.scenario import PLANTS, load_scenario, with_plant
from selfdrive.sim.trace_file import npz_pieces

SCENARIOS = Path(__file__).parents[2] / "fault_library" / "scenarios"
WORN = RoadLook(  # with every feature of a road
    left=LinePaint(dashed=True, wear=0.4, fade=0.2),
    right=LinePaint(double=True, wear=0.2),
    cracks_per_100_m=30.0,
    seams_per_100_m=10.0,
    patches_per_100_m=10.0,
    shadow_share=0.3,
    joint_spacing=5.0,
)
MOMENTS = [Moment(1.5 + 0.05 * k, 40.0 + 1.34 * k, 26.8) for k in range(20)]


def digests() -> Iterator[tuple[str, str]]:
    yield from ((name, digest(picture)) for name, picture in roads().items())
    for detector in DETECTORS:
        for level in (4, 9):
            yield from seen(detector, level)
    for path in sorted(SCENARIOS.glob("*.yaml")):
        for plant in PLANTS if path.stem[0] != "L" else PLANTS[:1]:  # the other has only straight roads
            yield f"{path.stem} on the {plant} plant", trace(path, plant, None)
    for detector in DETECTORS:
        pictures = PictureOptions(detector=detector, marks=DASHED_MARKS)
        yield f"S1 through {detector}", trace(SCENARIOS / "S1.yaml", "standard", pictures)
    coded = PictureOptions(detector=AUTHORS_CODE_DETECTOR, translation=AUTHORS_CODE_TRANSLATION)
    yield "S1 on the reference plant, as coded", trace(SCENARIOS / "S1.yaml", "reference", coded)


def roads() -> dict[str, np.ndarray]:
    model = CameraModel()
    found = {
        name: RoadRenderer(model, look, seed=3).render_grey(31.0, 0.4, 0.02)
        for name, look in (("solid", "solid"), ("dashed", "dashed"), ("worn", WORN))
    }
    solid = found["solid"]
    frame = Picture(("frame",), solid.shape, lambda region: solid[region.part])
    for mover in (HomographyMover(model), ShiftMover(model), AuthorsCodeShiftMover()):
        found[type(mover).__name__] = mover.seen(frame, 0.7, -0.015).pixels()
    return found


def seen(detector: str, level: int) -> Iterator[tuple[str, str]]:
    """Yield digests of the frames of each effect at `level`, or at its last level if it has fewer, and of the
    detections in them."""
    model = CameraModel()
    road = RoadRenderer(model, WORN, seed=3)
    frames = [road.render_grey(m.position, 0.3, 0.01) for m in MOMENTS]
    for effect, amounts in AMOUNTS_BY_EFFECT.items():
        made = effect(amounts[min(level, len(amounts) - 1)], 3, model)
        shown = [made.apply(frame, moment) for frame, moment in zip(frames, MOMENTS, strict=True)]
        eyes = camera_and_detector.build_detector(detector, model)
        lines = [eyes.detect(view(picture)) for picture in shown]
        name = f"{effect.__name__} {made.amount:g}"
        yield name, digest(np.array(shown))
        yield f"{detector} through {name}", sha256(repr(lines).encode()).hexdigest()


def view(picture: np.ndarray) -> CameraView:
    there = {"left_lane_y": 0.0, "right_lane_y": 0.0, "path_y": 0.0, "bend": (), "lead_d_rel": 50.0}
    return CameraView(**there, picture=picture)


def trace(path: Path, plant: str, pictures: PictureOptions | None) -> str:
    scenario = with_plant(load_scenario(path), plant)
    if pictures:
        scenario = replace(scenario, steps=1500)
    return sha256(b"".join(npz_pieces(simulate(scenario, 0, pictures).trace))).hexdigest()


def digest(picture: np.ndarray) -> str:
    return sha256(np.ascontiguousarray(picture).tobytes()).hexdigest()


if __name__ == "__main__":
    compiled.use_libraries_in(Path(sys.argv[1]) if sys.argv[1:] else None)
    print(json.dumps(dict(digests()), indent=1))
