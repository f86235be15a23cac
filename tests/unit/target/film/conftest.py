"""Films of short runs, with ideal vision or with camera frames, and synthetic frames."""

from pathlib import Path

import cv2
import pytest
from selfdrive.common.camera_model import CameraModel
from selfdrive.sim.film.recorded_film import DetectedLine, FilmFrame, RecordedFilm
from selfdrive.sim.road_renderer import RoadRenderer
from selfdrive.sim.run import main

SCENARIOS = Path(__file__).parents[4] / "fault_library" / "scenarios"
CALIBRATION = """
schema: camera/1
name: four frames
files: "*.png"
width: 640
rows: 480
fx_px: 309.4
fy_px: 344.2
cx_px: 317.9
cy_px: 256.5
pitch_deg: 14
height_m: 2.18
spacing_m: 1.342
"""


@pytest.fixture(scope="session")
def drive(tmp_path_factory):
    def go(*arguments, film=True):
        folder = tmp_path_factory.mktemp("run")
        words = ["--scenario", str(SCENARIOS / "S1.yaml"), "--out", str(folder), "--max-steps", "50"]
        words += ["--film", str(folder / "film")] if film else []
        assert main([*words, *arguments]) == 0
        return folder

    return go


@pytest.fixture(scope="session")
def seeing(tmp_path_factory):
    folder = tmp_path_factory.mktemp("frames")
    (folder / "camera.yaml").write_text(CALIBRATION)
    road = RoadRenderer(CameraModel(), "solid", 0)
    for number in range(4):
        cv2.imwrite(str(folder / f"{number}.png"), road.render_grey(1.342 * number))
    return "--pictures", "--frames", str(folder), "--cache", str(folder / "cache")


@pytest.fixture
def frame():
    """Build a frame in the middle of the lane with a lead 30 m ahead, with the given changes."""
    y = {"left": 1.85, "right": -1.85}
    usual = {
        "t": 0.0,
        "position": 0.0,
        "offset": 0.0,
        "heading": 0.0,
        "middle": 0.0,
        "v_ego": 20.0,
        "d_rel": 30.0,
        "bend": (0.0,) * 8,
        "picture": None,
        "lines": {name: DetectedLine(y=(at,) * 8, prob=1.0) for name, at in y.items()},
        "plan": (0.0,) * 8,
        "camera_lead": 30.0,
        "radar": 30.0,
        "alerts": (),
        "text": "",
        "hazards": (),
    }
    return lambda **given: FilmFrame(**usual | given)


@pytest.fixture
def reel(frame):
    """Build a film of frames 50 ms apart, with the given changes for each frame."""

    def make(*given):
        frames = tuple(frame(**{"t": 0.05 * i} | values) for i, values in enumerate(given))
        return RecordedFilm(camera=CameraModel(), frames=frames)

    return make
