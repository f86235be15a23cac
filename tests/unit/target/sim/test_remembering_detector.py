"""Detectors that look up earlier results in a memory."""

import subprocess
import sys
from itertools import pairwise
from pathlib import Path
from shutil import copytree

import numpy as np
import pytest
import selfdrive
from selfdrive.common.camera_model import CameraModel
from selfdrive.messages import CameraView
from selfdrive.sim.camera import GeometryCamera
from selfdrive.sim.detection_memory import FILE_NAME, DetectionMemory
from selfdrive.sim.effects import Brightness, Contrast, LowLight, PaperRain
from selfdrive.sim.effects.effect import Effect
from selfdrive.sim.image_library import RENDERED_SPACING, FrameLibrary
from selfdrive.sim.picture import Picture
from selfdrive.sim.picture_camera import PictureCamera
from selfdrive.sim.picture_options import GROUND_TRANSLATION, SHIFT_TRANSLATION
from selfdrive.sim.remembering_detector import DETECTION_FILES, RememberingDetector, detection_files_digest
from selfdrive.sim.road import Road
from selfdrive.sim.road_renderer import RoadRenderer
from selfdrive.visiond.paper_detector import PaperDetector
from selfdrive.visiond.robust_detector import RobustDetector

ROOT = Path(selfdrive.__path__[0])
MODEL = CameraModel()


@pytest.fixture(scope="module")
def frames():
    renderer = RoadRenderer(MODEL, "dashed", 3, periods=1)
    return np.stack([renderer.render_grey(k * RENDERED_SPACING) for k in range(3)])


@pytest.fixture
def look(frames, truth):
    def taken(translation=GROUND_TRANSLATION, digest="d", **pose):
        library = FrameLibrary(
            name="few", digest=digest, model=MODEL, frames=frames, spacing=RENDERED_SPACING, fps=None
        )
        camera = PictureCamera(GeometryCamera(Road(None, None)), library, translation)
        return camera.look(truth(**pose)).picture

    return taken


def view(picture):
    nan = float("nan")
    return CameraView(nan, nan, nan, (), nan, picture)


class Counting:
    def __init__(self):
        self.asked, self.state = 0, ()
        self._detector = PaperDetector(MODEL)

    def detect(self, view):
        self.asked += 1
        return self._detector.detect(view)


@pytest.mark.parametrize("make", [PaperDetector, RobustDetector])
def test_remembered_lines_equal_detected_ones(make, look, tmp_path):
    rain = PaperRain(6, 1, MODEL)
    way = [(0.03 * k, 0.001 * k, 0.7 * k) for k in range(8)]
    seen = [look(lateral_offset=y, heading=turn, position=x) for y, turn, x in way]

    class Then:
        t, position, v_ego = 1.0, 20.0, 26.0

    seen += [rain.apply(picture, Then) for picture in seen] + seen[:2]
    plain = make(MODEL)
    expected = [repr(plain.detect(view(np.asarray(picture)))) for picture in seen]
    for known in (0, 9, len(seen)):
        detector = RememberingDetector(make(MODEL), "it", DetectionMemory(tmp_path))
        for number, picture in enumerate(seen):
            assert repr(detector.detect(view(picture))) == expected[number], (known, number)
            if known == 9 and number == 8:  # the rest is detected again, based on the recalled part
                (tmp_path / FILE_NAME).unlink()
                detector._memory = DetectionMemory(tmp_path)


def test_a_known_image_is_not_analysed_again(look, tmp_path):
    looking = Counting()
    detector = RememberingDetector(looking, "it", DetectionMemory(tmp_path))
    lines = detector.detect(view(look(lateral_offset=0.1)))

    def unseen(*_):
        raise AssertionError("the pixels were computed")

    known = look(lateral_offset=0.1)
    assert detector.detect(view(Picture(known.key, known.shape, unseen))) == lines and looking.asked == 1
    for _ in range(2):
        assert detector.detect(view(np.asarray(known))) == lines
    assert looking.asked == 3


def test_different_images_have_different_keys(look, truth):
    base = look()
    moment, later = truth(t=1.0), truth(t=1.05)
    rain, light = PaperRain(5, 1, MODEL), Brightness(20, 1, MODEL)
    pictures = [
        base,
        look(position=RENDERED_SPACING),
        look(lateral_offset=0.004),
        look(lateral_offset=-0.004),
        look(heading=0.00025),
        look(SHIFT_TRANSLATION, lateral_offset=0.2),
        look(SHIFT_TRANSLATION, lateral_offset=0.4),
        look(digest="e"),
        rain.apply(base, moment),
        rain.apply(base, later),
        rain.apply(look(lateral_offset=0.004), moment),
        PaperRain(5.5, 1, MODEL).apply(base, moment),
        PaperRain(5, 2, MODEL).apply(base, moment),
        LowLight(5, 1, MODEL).apply(base, moment),
        light.apply(base, moment),
        Contrast(2, 1, MODEL).apply(base, moment),
        light.apply(rain.apply(base, moment), moment),
        rain.apply(light.apply(base, moment), moment),
    ]
    assert len({repr(picture.key) for picture in pictures}) == len(pictures)
    looks = [np.asarray(picture) for picture in pictures if picture.key[0] == "d"]
    assert not any(np.array_equal(one, other) for one, other in pairwise(looks))


def test_equal_images_have_equal_keys(look, truth):
    assert look(lateral_offset=0.1).key == look(lateral_offset=0.1004).key
    light = Brightness(20, 1, MODEL)
    assert light.apply(look(), truth(t=1.0)).key == light.apply(look(), truth(t=2.0)).key


def test_results_of_other_effects_are_not_remembered(look, truth):
    """An effect whose code is not in the digest returns an array."""

    class Upside(Effect):
        UNIT, LEAST, MOST = "times", 0.0, 1.0

        def _prepare(self, random):
            pass

        def _affect(self, picture, region, scene):
            return picture[::-1].copy()

    picture = Upside(1, 0, MODEL).apply(look(), truth())
    assert isinstance(picture, np.ndarray) and np.array_equal(picture, np.asarray(look())[::-1])


def test_the_digest_changes_only_with_code_that_affects_detection(tmp_path):
    root = tmp_path / "selfdrive"
    copytree(ROOT, root)
    before = detection_files_digest(root)
    assert before == detection_files_digest(ROOT)
    for unrelated in ("visiond/visiond.py", "sim/picture_camera.py", "controls/plannerd.py"):
        (root / unrelated).write_text("")
    assert detection_files_digest(root) == before
    files = [file for pattern in DETECTION_FILES for file in root.glob(pattern)]
    assert len(files) == len(set(files)) > 40
    for file in files:
        kept = file.read_bytes()
        file.write_bytes(kept + b"\n")
        assert detection_files_digest(root) != before, file
        file.write_bytes(kept)


def test_the_digest_covers_all_code_of_detectors_frames_and_effects():
    """Messages, errors, conversions, the reading of YAML and the geometry of the view are exceptions."""
    code = (
        "import sys, selfdrive.visiond.paper_detector, selfdrive.visiond.robust_detector\n"
        "import selfdrive.sim.effects, selfdrive.sim.image_library, selfdrive.sim.moved_picture\n"
        "import selfdrive.sim.remembering_detector\n"
        "print(*[m.__file__ for n, m in sys.modules.items() if n.startswith('selfdrive')], sep='\\n')"
    )
    command = [sys.executable, "-c", code]
    done = subprocess.run(
        command, env={"PYTHONPATH": str(ROOT.parent)}, capture_output=True, text=True, check=True
    )
    loaded = {Path(name).relative_to(ROOT).as_posix() for name in done.stdout.split()}
    covered = {
        file.relative_to(ROOT).as_posix() for pattern in DETECTION_FILES for file in ROOT.glob(pattern)
    }
    plain = {"__init__.py", "common/__init__.py", "sim/__init__.py", "messages.py", "common/errors.py"}
    plain |= {"common/conversions.py", "sim/yaml_section.py"}  # the camera is in the key
    plain |= {"common/interp.py", "sim/camera.py", "sim/road.py", "sim/truth.py"}  # the view's geometry
    assert loaded - covered <= plain
