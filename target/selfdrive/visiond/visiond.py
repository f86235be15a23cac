"""visiond: from the camera's view to the road model, 20 times a second."""

from selfdrive.messages import ModelData
from selfdrive.sim.camera import CameraView


class Visiond:
    """Ideal vision: passes on the geometry that the simulated camera sees.

    `latest` is the newest published ModelData, None before the first; its `t` tells its age.
    """

    def __init__(self) -> None:
        self.latest: ModelData | None = None

    def update(self, view: CameraView, t: float) -> None:
        """Form a road model of the view taken at time `t` (s) and publish it."""
        raise NotImplementedError

    def publish(self, model: ModelData) -> None:
        """Make the model visible to the rest of the controller."""
        self.latest = model
