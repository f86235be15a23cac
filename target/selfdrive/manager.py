"""Runs the controller's parts in lockstep with the car: visiond, radard, controlsd."""

from selfdrive.messages import CanFrame, RadarState


class Manager:
    """All of the controller. One `step` for each 10 ms of the car's time.

    `car`, `radar`, `visiond` are CarInterface, RadarInterface and Visiond; the car's parameters
    are `car.params`.
    """

    def __init__(self, car, radar, visiond) -> None:
        self.radar_state: RadarState | None = None
        self.controlsd = None
        self.radard = None

    def step(self, t: float, frames: list[CanFrame], view) -> list[CanFrame]:
        """One step at time `t` (s) with all frames received since the last one; returns those to send.

        `view` is a CameraView or None when the camera has no new picture. controlsd starts ten
        steps after the car, as the original does.
        """
        raise NotImplementedError
