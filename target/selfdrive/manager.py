"""Runs the controller's parts in lockstep with the car: visiond, radard, controlsd."""

from selfdrive.car.honda.interface import CarInterface
from selfdrive.car.honda.radar_interface import RadarInterface
from selfdrive.controls.controlsd import Controlsd
from selfdrive.controls.lib.pathplanner import ModelFit
from selfdrive.controls.radard import Radard
from selfdrive.messages import CameraView, CanFrame, RadarState
from selfdrive.visiond.visiond import Visiond

# First step of the control loop: the original's process starts 0.1 s after the car, so its first cycle has no
# CAN frames.
START_STEP = 11


class Manager:
    def __init__(self, car: CarInterface, radar: RadarInterface, visiond: Visiond) -> None:
        self._radar = radar
        self.visiond = visiond
        fit = ModelFit()
        self.radard = Radard(car.params, fit)
        self.controlsd = Controlsd(car.params, car, fit)
        self.radar_state: RadarState | None = None
        self._step = 0

    def step(self, t: float, frames: list[CanFrame], view: CameraView | None) -> list[CanFrame]:
        """Advance 10 ms to time `t` (s) with all frames received since the last step; return the frames to
        send.

        `view` is None when the camera has no new picture.
        """
        if view is not None:
            self.visiond.update(view, t)
        radar = self._radar.update(frames, t)
        step = self._step
        self._step += 1
        if step < START_STEP:
            return []
        if step == START_STEP:
            frames = []
        elif radar is not None:  # radard waits for the first speed from controlsd
            self.radar_state = self.radard.update(radar, self.visiond.latest, self.controlsd.state)
        return self.controlsd.update(t, frames, self.radar_state, self.visiond.latest)
