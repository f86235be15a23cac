"""A lane detector that stores and reuses results."""

import platform
import sys
from collections.abc import Iterator
from hashlib import blake2b, sha256
from pathlib import Path
from typing import Protocol

import cv2
import numpy as np

import selfdrive
from selfdrive.messages import CameraView
from selfdrive.sim.detection_memory import KEY_BYTES, DetectionMemory
from selfdrive.sim.picture import Picture
from selfdrive.visiond.detector import LaneDetector, LaneLines, RoadLine

# All files that determine what is seen in a picture with a given key. visiond.py only uses the result, and
# picture_camera.py's choice of picture is in the key.
DETECTION_FILES = (
    "common/array_math.py",
    "common/camera_model.py",
    "common/compiled.py",
    "common/ordered.py",
    "sim/compiled_warp.py",
    "sim/detection_memory.py",
    "sim/effects/*.c",
    "sim/effects/*.py",
    "sim/image_folder.py",
    "sim/image_library.py",
    "sim/lead_picture.py",
    "sim/moved_picture.py",
    "sim/picture.py",
    "sim/picture_options.py",
    "sim/remembering_detector.py",
    "sim/road_*.py",
    "sim/camera_and_detector.py",
    "sim/warp.*",
    "visiond/[!v]*.py",
    "visiond/voting.py",
    "visiond/*.[ch]",
    "visiond/*_net.npz",
    "visiond/paper_confidence.json",
)
_NUMBERS_OF_LINES = 9  # for three lines


class DetectorWithState(LaneDetector, Protocol):
    """A detector whose lines depend only on the picture and on the detector's own `state`."""

    state: tuple[float, ...]


class RememberingDetector:
    """Returns the results of `detector`. If `memory` has a result, no pixels are calculated.

    The detector must be deterministic in picture and state. `made_of` (such as name and camera)
    distinguishes detectors with the same code.
    """

    def __init__(self, detector: DetectorWithState, made_of: object, memory: DetectionMemory) -> None:
        self._detector, self._memory = detector, memory
        self._key_prefix = detection_files_digest(Path(selfdrive.__path__[0])) + repr(made_of).encode()

    def detect(self, view: CameraView) -> LaneLines:
        """Return the lines in the picture. Plain arrays, which have no key, are always examined."""
        picture, detector = view.picture, self._detector
        if not isinstance(picture, Picture):
            return detector.detect(view)
        text = repr((picture.key, detector.state)).encode()  # repr is unique per float
        key = blake2b(self._key_prefix + text, digest_size=KEY_BYTES).digest()
        stored = self._memory.recall(key)
        if stored is not None:
            detector.state = stored[_NUMBERS_OF_LINES:]
            return LaneLines(*(RoadLine(*stored[k : k + 3]) for k in range(0, _NUMBERS_OF_LINES, 3)))
        lines = detector.detect(view)
        self._memory.store(key, [number for line in lines for number in line[:3]] + list(detector.state))
        return lines


def detection_files_digest(root: Path) -> bytes:
    digest = sha256()
    calculator = sys.version, platform.machine(), cv2.__version__, cv2.getCPUFeaturesLine(), np.__version__
    digest.update(repr(calculator).encode())
    for name, data in _read_detection_files(root):
        digest.update(repr(name).encode())
        digest.update(sha256(data).digest())
    return digest.digest()


def _read_detection_files(root: Path) -> Iterator[tuple[str, bytes]]:
    for pattern in DETECTION_FILES:
        for file in sorted(root.glob(pattern)):
            yield file.relative_to(root).as_posix(), file.read_bytes()
