"""radard: from radar tracks and the camera's lead to the leads to follow, 20 times a second."""

from selfdrive.car.params import CarParams
from selfdrive.messages import ControlsState, ModelData, RadarData, RadarState


class Radard:
    """Turns each complete radar cycle into a RadarState."""

    def __init__(self, params: CarParams) -> None:
        raise NotImplementedError

    def update(self, radar: RadarData, model: ModelData | None, controls: ControlsState) -> RadarState:
        """One radar cycle with the newest model and controls state."""
        raise NotImplementedError
