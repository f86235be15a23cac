"""What the controller sees in a run: ideal geometry, or pictures with a detector.

Only runs with pictures import picture libraries, which load slowly.
"""

from dataclasses import dataclass
from typing import Protocol

from selfdrive.common import compiled
from selfdrive.common.camera_model import CameraModel
from selfdrive.common.errors import ConfigError
from selfdrive.messages import CameraView
from selfdrive.sim.camera import GeometryCamera
from selfdrive.sim.picture_options import AUTHORS_CODE_DETECTOR, PAPER_DETECTOR, PictureOptions
from selfdrive.sim.road import Road
from selfdrive.sim.truth import GroundTruth
from selfdrive.visiond.detector import IdealDetector, LaneDetector


class RoadCamera(Protocol):
    def look(self, truth: GroundTruth) -> CameraView:
        """Return the view at this moment."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraAndDetector:
    """Camera and detector of one run; `for_record` describes them in its record, None without pictures.

    `model` is the camera's geometry, for drawing the view if there are no pictures.
    """

    camera: RoadCamera
    detector: LaneDetector
    for_record: dict | None
    model: CameraModel


def build_camera_and_detector(pictures: PictureOptions | None, road: Road, seed: int) -> CameraAndDetector:
    """Return camera and detector for a run. Raises ConfigError for unusable frames, and for pictures of a
    road that is not straight."""
    if pictures is None:
        return CameraAndDetector(
            camera=GeometryCamera(road), detector=IdealDetector(), for_record=None, model=CameraModel()
        )
    from selfdrive.sim.image_library import open_frame_library
    from selfdrive.sim.picture_camera import PictureCamera

    if road.bend(0.0, 1) is not None:
        raise ConfigError(
            "a road with curvature",
            expected="a straight road for runs with pictures",
            remedy="run it without pictures",
        )
    if pictures.ignore_stored:
        compiled.use_libraries_in(None)
    library = open_frame_library(pictures, seed)
    camera = PictureCamera(GeometryCamera(road), library, pictures.translation)
    description = {
        "detector": pictures.detector,
        "frames": library.name,
        "frames_digest": library.digest,
        "translation": pictures.translation,
    }
    if pictures.threshold is not None:
        description["threshold"] = pictures.threshold
    return CameraAndDetector(
        camera=camera,
        detector=_build_detector_with_memory(pictures, camera),
        for_record=description,
        model=library.model,
    )


def build_detector(name: str, model: CameraModel, threshold: float | None = None):
    """Return a detector; `threshold` is for the one as coded; None: its own."""
    if name == PAPER_DETECTOR:
        from selfdrive.visiond.compiled_paper import build_paper_detector

        return build_paper_detector(model)
    if name == AUTHORS_CODE_DETECTOR:
        from selfdrive.visiond.compiled_authors_code import MIN_LOG_ODDS, build_authors_code_detector

        return build_authors_code_detector(model, MIN_LOG_ODDS if threshold is None else threshold)
    from selfdrive.visiond.compiled_robust import build_robust_detector

    return build_robust_detector(model)


def _build_detector_with_memory(pictures: PictureOptions, camera) -> LaneDetector:
    from selfdrive.sim.detection_memory import DetectionMemory
    from selfdrive.sim.remembering_detector import RememberingDetector

    detector = build_detector(pictures.detector, camera.model, pictures.threshold)
    if pictures.ignore_stored or pictures.cache is None:
        return detector
    memory = DetectionMemory(pictures.cache)
    made_of = (
        pictures.detector,
        pictures.threshold,
        camera.model,
        detector.calculated_by,
        camera.calculated_by,
    )
    return RememberingDetector(detector, made_of, memory)
