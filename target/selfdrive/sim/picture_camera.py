"""The camera of a run with pictures."""

from selfdrive.common.camera_model import CameraModel
from selfdrive.messages import CameraView
from selfdrive.sim.camera import GeometryCamera
from selfdrive.sim.image_library import FrameLibrary
from selfdrive.sim.moved_picture import AuthorsCodeShiftMover, HomographyMover, ShiftMover
from selfdrive.sim.picture_options import GROUND_TRANSLATION, SHIFT_TRANSLATION
from selfdrive.sim.truth import GroundTruth


class PictureCamera:
    """Takes the view's geometry from `geometry` and its picture from `library`, moved to the car's position.

    `calculated_by` identifies the compiled code that moves frames, if any. `translation` is that of
    `PictureOptions`.
    """

    def __init__(self, geometry: GeometryCamera, library: FrameLibrary, translation: str) -> None:
        self._geometry, self._library = geometry, library
        self.model = library.model
        self._move = _build_mover(translation, self.model)
        self.calculated_by = self._move.calculated_by

    def look(self, truth: GroundTruth) -> CameraView:
        view = self._geometry.look(truth)
        frame = self._library.frame(truth.t, truth.position)
        picture = self._move.seen(frame, truth.lateral_offset, truth.heading)
        return view._replace(picture=picture)


def _build_mover(
    translation: str, model: CameraModel
) -> HomographyMover | ShiftMover | AuthorsCodeShiftMover:
    if translation == GROUND_TRANSLATION:
        return HomographyMover(model)
    return ShiftMover(model) if translation == SHIFT_TRANSLATION else AuthorsCodeShiftMover()
