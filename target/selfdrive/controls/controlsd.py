"""controlsd: sample, plan, decide, control, send - once every 10 ms."""

from selfdrive.car.params import CarParams
from selfdrive.messages import CanFrame, ControlsState, ModelData, Plan, RadarState


class Controlsd:
    """The control loop. `car` is the CarInterface: `update(frames, t) -> CarState`, `apply(control, frame)`.

    `state` and `plan` hold the newest ControlsState and Plan after each update.
    """

    def __init__(self, params: CarParams, car) -> None:
        self.state = ControlsState()
        self.plan = Plan()
        raise NotImplementedError

    def update(
        self, t: float, frames: list[CanFrame], radar_state: RadarState | None, model: ModelData | None
    ) -> list[CanFrame]:
        """Run one cycle at time `t` (s) and return the frames to send.

        `radar_state` and `model` are the newest ones, however old; None before the first.
        """
        raise NotImplementedError
