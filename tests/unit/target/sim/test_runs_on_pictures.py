"""Runs in which the controller sees the road in frames."""

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import selfdrive
from selfdrive.common.camera_model import CameraModel
from selfdrive.messages import CameraView
from selfdrive.sim import camera_and_detector, detection_memory
from selfdrive.sim.detection_memory import ENTRY_BYTES, FILE_NAME, DetectionMemory
from selfdrive.sim.effects import PaperRain
from selfdrive.sim.image_library import RENDERED_SPACING
from selfdrive.sim.picture import Picture
from selfdrive.sim.picture_camera import PictureCamera
from selfdrive.sim.picture_options import (
    AUTHORS_CODE_DETECTOR,
    AUTHORS_CODE_TRANSLATION,
    GROUND_TRANSLATION,
    PAPER_DETECTOR,
    ROBUST_DETECTOR,
    SHIFT_TRANSLATION,
    PictureOptions,
)
from selfdrive.sim.road_renderer import RoadRenderer
from selfdrive.sim.run import main, simulate, write_run
from selfdrive.sim.scenario import REFERENCE_PLANT, STANDARD_PLANT, load_scenario, with_plant
from selfdrive.visiond.detector import LaneLines, RoadLine, path_between

CALIBRATION = f"""\
schema: camera/1
name: nine frames
files: "*.png"
width: 640
rows: 480
fx_px: 309.4
fy_px: 344.2
cx_px: 317.9
cy_px: 256.5
height_m: 2.18
pitch_deg: 14
spacing_m: {RENDERED_SPACING}
"""


class LineReader:
    """A detector that reads only the lane's lines from the image, near their last positions."""

    def __init__(self, model: CameraModel) -> None:
        self._model = model
        self._last = [(1.85, 0.0), (-1.85, 0.0)]

    def detect(self, view: CameraView) -> LaneLines:
        assert view.picture is not None
        picture = view.picture.astype(float)
        self._last = [self._line(picture, *line) for line in self._last]
        left, right = (RoadLine(y=y, slope=slope) for y, slope in self._last)
        return LaneLines(left=left, right=right, path=path_between(left, right))

    def _line(self, picture: np.ndarray, y: float, slope: float) -> tuple[float, float]:
        a, b = self._model.line_in_picture(y, slope)
        seen = []
        for row in range(230, 400, 4):
            half = max(5.0, 0.35 / self._model.metres_per_pixel(row))
            columns = np.arange(int(a * row + b - half), int(a * row + b + half) + 1)
            if columns[0] >= 0 and columns[-1] < self._model.width:
                light = np.clip(picture[row, columns] - picture[row, columns].mean() - 25.0, 0.0, None)
                if light.sum() > 0.0:
                    seen.append((row, light @ columns / light.sum()))
        return (
            self._model.line_on_road(*np.polyfit(*zip(*seen, strict=True), 1))
            if len(seen) > 6
            else (y, slope)
        )


@pytest.fixture
def frames(tmp_path):
    """A folder of nine frames, one dash period of a rendered road, with their calibration."""
    folder = tmp_path / "frames"
    folder.mkdir()
    (folder / "camera.yaml").write_text(CALIBRATION)
    renderer = RoadRenderer(CameraModel(), "solid", 0, periods=1)
    for number in range(9):
        cv2.imwrite(str(folder / f"{number:04}.png"), renderer.render_grey(number * RENDERED_SPACING))
    return folder


def brought_aside(scenarios, steps):
    return replace(load_scenario(scenarios / "S1.yaml"), lateral_offset=0.3, steps=steps)


@pytest.mark.parametrize(
    ("translation", "left_over"), [(GROUND_TRANSLATION, 0.06), (SHIFT_TRANSLATION, 0.15)]
)
def test_a_car_that_sees_only_frames_returns_to_the_middle(
    monkeypatch, scenarios, frames, tmp_path, translation, left_over
):
    monkeypatch.setattr(
        camera_and_detector,
        "_build_detector_with_memory",
        lambda pictures, library: LineReader(library.model),
    )
    pictures = PictureOptions(frames=frames, translation=translation, cache=tmp_path / "cache")
    result = simulate(brought_aside(scenarios, 1000), 0, pictures)
    offset = np.abs(result.trace["lateral_offset"])
    assert offset[0] > 0.25 and offset.max() < 0.4 and offset[-300:].max() < left_over
    assert result.record["pictures"]["translation"] == translation


@pytest.mark.parametrize("detector", [PAPER_DETECTOR, ROBUST_DETECTOR, AUTHORS_CODE_DETECTOR])
def test_the_detection_memory_changes_no_byte_of_a_run(monkeypatch, scenarios, frames, tmp_path, detector):
    monkeypatch.setattr(detection_memory, "BUCKET_COUNT", 512)
    clean, look = PictureCamera.look, []

    def rainy(self, truth):
        seen = clean(self, truth)
        if truth.t < 0.5:
            return seen
        rain = PaperRain(5, 7, self.model) if not look else look[0]
        look[:] = [rain]
        return seen._replace(picture=rain.apply(seen.picture, truth))

    monkeypatch.setattr(PictureCamera, "look", rainy)
    cache, without = tmp_path / "cache", tmp_path / "without"
    (without / FILE_NAME).mkdir(parents=True)

    def bytes_of(run, cache):
        out = tmp_path / run
        pictures = PictureOptions(detector=detector, frames=frames, cache=cache)
        write_run(simulate(brought_aside(scenarios, 100), 0, pictures), out)
        return (out / "trace.npz").read_bytes(), (out / "record.json").read_bytes()

    plain = bytes_of("without", without)
    assert bytes_of("cold", cache) == plain
    with monkeypatch.context() as patched:
        patched.setattr(Picture, "pixels", None)
        patched.setattr(Picture, "__getitem__", None)
        assert bytes_of("warm", cache) == plain
    table = bytearray((cache / FILE_NAME).read_bytes())
    for at in range(30, len(table), ENTRY_BYTES):
        table[at] ^= 1
    (cache / FILE_NAME).write_bytes(table)
    assert bytes_of("damaged", cache) == plain


def test_a_run_with_forget_ignores_the_memory(monkeypatch, scenarios, frames, tmp_path):
    monkeypatch.setattr(detection_memory, "BUCKET_COUNT", 512)
    cache = tmp_path / "cache"

    def bytes_of(name, *more):
        out = tmp_path / name
        arguments = ["--scenario", str(scenarios / "S1.yaml"), "--out", str(out), "--max-steps", "140"]
        arguments += ["--pictures", "--frames", str(frames), "--cache", str(cache), *more]
        assert main(arguments) == 0
        return (out / "trace.npz").read_bytes(), (out / "record.json").read_bytes()

    plain = bytes_of("first", "--forget")
    assert not (cache / FILE_NAME).exists()
    assert bytes_of("remembered") == plain
    recall = DetectionMemory.recall

    def wrong(self, key):
        kept = recall(self, key)
        return kept and (kept[0] + 0.3, *kept[1:])

    monkeypatch.setattr(DetectionMemory, "recall", wrong)
    assert bytes_of("misled") != plain
    assert bytes_of("forgotten", "--forget") == plain


def test_a_run_on_frames_has_one_thread(scenarios, frames, tmp_path):
    """Neither imports nor detectors start a second thread, so the process can be forked."""
    code = (
        "import os, sys; from pathlib import Path; from dataclasses import replace\n"
        "from selfdrive.sim.run import simulate; from selfdrive.sim.scenario import load_scenario\n"
        "from selfdrive.sim.picture_options import PictureOptions\n"
        "scenario = replace(load_scenario(Path(sys.argv[1])), steps=20)\n"
        "simulate(scenario, 0, PictureOptions(frames=Path(sys.argv[2]), cache=Path(sys.argv[3])))\n"
        "print(len(os.listdir('/proc/self/task')))"
    )
    root = str(Path(selfdrive.__path__[0]).parent)
    command = [sys.executable, "-c", code, str(scenarios / "S1.yaml"), str(frames), str(tmp_path)]
    single = {"PYTHONPATH": root, "OPENBLAS_NUM_THREADS": "1"}  # OpenBLAS starts threads by default
    printed = subprocess.run(command, env=single, capture_output=True, text=True, check=True)
    assert printed.stdout.strip() == "1"


def test_runs_with_ideal_vision_do_not_import_the_slow_libraries():
    code = (
        "import sys; from pathlib import Path; from dataclasses import replace\n"
        "from selfdrive.sim.run import simulate; from selfdrive.sim.scenario import load_scenario\n"
        "simulate(replace(load_scenario(Path(sys.argv[1])), steps=20), 0)\n"
        "print([name for name in ('cv2', 'selfdrive.sim.road_renderer') if name in sys.modules])"
    )
    root = Path(selfdrive.__path__[0]).parent
    command = [sys.executable, "-c", code, str(root.parent / "fault_library" / "scenarios" / "S1.yaml")]
    printed = subprocess.run(
        command, env={"PYTHONPATH": str(root)}, capture_output=True, text=True, check=True
    )
    assert printed.stdout.strip() == "[]"


@pytest.mark.slow
@pytest.mark.parametrize("translation", [GROUND_TRANSLATION, SHIFT_TRANSLATION])
def test_all_scenarios_run_without_alerts_on_the_rendered_road(
    monkeypatch, scenarios, tmp_path_factory, translation
):
    monkeypatch.setattr(
        camera_and_detector,
        "_build_detector_with_memory",
        lambda pictures, library: LineReader(library.model),
    )
    pictures = PictureOptions(translation=translation, cache=tmp_path_factory.getbasetemp() / "pictures")
    for name in ("S1", "S2", "S3", "S4", "S5"):
        result = simulate(load_scenario(scenarios / f"{name}.yaml"), 0, pictures)
        assert set(result.record["hazards"].values()) == {None}
        assert "steer_saturated" not in {alert["name"] for alert in result.record["alerts"]}
        assert np.abs(result.trace["lateral_offset"]).max() < 0.1


@pytest.mark.slow
@pytest.mark.parametrize(
    ("plant", "translation", "alerting", "aside"),
    [
        (STANDARD_PLANT, GROUND_TRANSLATION, set(), 0.2),
        (REFERENCE_PLANT, AUTHORS_CODE_TRANSLATION, {"S2", "S4"}, 0.6),
    ],
)
def test_fault_free_runs_with_the_detector_as_coded_have_no_hazard(
    scenarios, tmp_path_factory, plant, translation, alerting, aside
):
    """On the reference plant, two of the runs raise *steer saturated*."""
    cache = tmp_path_factory.getbasetemp() / "pictures"
    pictures = PictureOptions(detector=AUTHORS_CODE_DETECTOR, translation=translation, cache=cache)
    found = set()
    for name in ("S1", "S2", "S3", "S4", "S5"):
        result = simulate(with_plant(load_scenario(scenarios / f"{name}.yaml"), plant), 0, pictures)
        assert set(result.record["hazards"].values()) == {None}
        assert np.abs(result.trace["lateral_offset"]).max() < aside
        if "steer_saturated" in {alert["name"] for alert in result.record["alerts"]}:
            found.add(name)
    assert found == alerting


def test_the_threshold_of_the_detector_as_coded_can_be_chosen(scenarios, tmp_path):
    """Another threshold detects other lines and is recorded; detections are stored by threshold."""
    steps, traces, records = 150, {}, {}
    for name, arguments in (("own", []), ("same", ["--threshold", "4.0"]), ("none", ["--threshold", "50"])):
        out = tmp_path / name
        command = ["--scenario", str(scenarios / "S1.yaml"), "--out", str(out), "--pictures"]
        command += ["--detector", "as_coded", "--cache", str(tmp_path / "cache"), "--max-steps", str(steps)]
        assert main([*command, *arguments]) == 0
        traces[name], records[name] = (
            (out / "trace.npz").read_bytes(),
            json.loads((out / "record.json").read_text()),
        )
    assert traces["own"] == traces["same"] != traces["none"]
    assert "threshold" not in records["own"]["pictures"]
    assert records["none"]["pictures"]["threshold"] == 50.0


@pytest.mark.parametrize("arguments", [[], ["--pictures"], ["--pictures", "--detector", "robust"]])
def test_a_threshold_without_the_detector_as_coded_is_refused(scenarios, tmp_path, capsys, arguments):
    command = ["--scenario", str(scenarios / "S1.yaml"), "--out", str(tmp_path), "--threshold", "2.5"]
    assert main([*command, *arguments]) == 2
    assert (
        "error: --threshold 2.5, expected --pictures and --detector as_coded with it"
        in capsys.readouterr().err
    )


@pytest.mark.parametrize("value", ["nan", "inf", "high"])
def test_a_threshold_is_a_finite_number(scenarios, tmp_path, capsys, value):
    command = ["--scenario", str(scenarios / "S1.yaml"), "--out", str(tmp_path), "--threshold", value]
    with pytest.raises(SystemExit) as ended:
        main(command)
    assert ended.value.code == 2
    assert f"{value!r} is not a finite number" in capsys.readouterr().err
