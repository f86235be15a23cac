"""Runs the controller's parts in lockstep with the car: visiond, radard, controlsd."""

from selfdrive.car.honda.interface import CarInterface
from selfdrive.car.honda.radar_interface import RadarInterface
from selfdrive.controls.controlsd import Controlsd
from selfdrive.controls.lib.pathplanner import ModelFit
from selfdrive.controls.radard import Radard
from selfdrive.messages import CameraView, CanFrame, RadarState
from selfdrive.visiond.visiond import Visiond

# First step of the control loop. The original's process is up 0.1 s after the car; its first speed
# reading comes another two cycles later.
START_STEP = 12


class Manager:
    """All of the controller. One `step` for each 10 ms of the car's time."""

    def __init__(self, car: CarInterface, radar: RadarInterface, visiond: Visiond) -> None:
        self._radar = radar
        self.visiond = visiond
        fit = ModelFit()
        self.radard = Radard(car.params, fit)
        self.controlsd = Controlsd(car.params, car, fit)
        self.radar_state: RadarState | None = None
        self._step = 0

    def step(self, t: float, frames: list[CanFrame], view: CameraView | None) -> list[CanFrame]:
        """One step at time `t` (s) with all frames received since the last one; returns those to send.

        `view` is None when the camera has no new picture.
        """
        if view is not None:
            self.visiond.update(view, t)
        radar = self._radar.update(frames, t)
        started = self._step >= START_STEP
        # radard waits for the first speed from controlsd
        if radar is not None and self._step > START_STEP:
            self.radar_state = self.radard.update(radar, self.visiond.latest, self.controlsd.state)
        self._step += 1
        if not started:
            return []
        return self.controlsd.update(t, frames, self.radar_state, self.visiond.latest)
