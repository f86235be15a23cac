"""The camera of a run with pictures: the library's frame, as it would look from where the car is."""

from selfdrive.messages import CameraView
from selfdrive.sim.camera import Camera
from selfdrive.sim.image_library import ImageLibrary
from selfdrive.sim.moved_picture import GroundView, ShiftedView
from selfdrive.sim.truth import GroundTruth
from selfdrive.sim.vision import GROUND


class PictureCamera:
    """Takes the view's geometry from `geometry` and its picture from `library`.

    `translation` is "ground", by the road's homography, or "shift": the frame moves sideways as a whole.
    """

    def __init__(self, geometry: Camera, library: ImageLibrary, translation: str) -> None:
        self._geometry, self._library = geometry, library
        self.model = library.model
        self._move = GroundView(self.model) if translation == GROUND else ShiftedView(self.model)

    def look(self, truth: GroundTruth) -> CameraView:
        """The view at this moment. Its picture must not be written to."""
        view = self._geometry.look(truth)
        frame = self._library.frame(truth.t, truth.position)
        picture = self._move.seen(frame, truth.lateral_offset, truth.heading)
        return view._replace(picture=picture)
