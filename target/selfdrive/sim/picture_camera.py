"""The camera of a run with pictures."""

from selfdrive.common.camera_model import CameraModel
from selfdrive.messages import CameraView
from selfdrive.sim.camera import Camera
from selfdrive.sim.image_library import ImageLibrary
from selfdrive.sim.moved_picture import CodedView, GroundView, ShiftedView
from selfdrive.sim.picture_options import GROUND, SHIFT
from selfdrive.sim.truth import GroundTruth


class PictureCamera:
    """Takes the view's geometry from `geometry` and its picture from `library`, moved to the car's position.

    `calculated_by` identifies the compiled code that moves frames, if any. `translation` is as in `Pictures`.
    """

    def __init__(self, geometry: Camera, library: ImageLibrary, translation: str) -> None:
        self._geometry, self._library = geometry, library
        self.model = library.model
        self._move = _mover(translation, self.model)
        self.calculated_by = self._move.calculated_by

    def look(self, truth: GroundTruth) -> CameraView:
        view = self._geometry.look(truth)
        frame = self._library.frame(truth.t, truth.position)
        picture = self._move.seen(frame, truth.lateral_offset, truth.heading)
        return view._replace(picture=picture)


def _mover(translation: str, model: CameraModel) -> GroundView | ShiftedView | CodedView:
    if translation == GROUND:
        return GroundView(model)
    return ShiftedView(model) if translation == SHIFT else CodedView()
