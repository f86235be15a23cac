"""The Honda Civic Touring 2016 as the controller sees it: CAN in, CarState out; CarControl in, CAN out."""

from collections.abc import Sequence

from selfdrive.car.params import CarParams
from selfdrive.messages import CanFrame, CarControl, CarState


def get_params() -> CarParams:
    """Physical data and tuning of the Civic."""
    raise NotImplementedError


class CarInterface:
    """Reads the car and commands it. One instance drives one run; all state lives here.

    `params` is the CarParams the interface was made with. `update` raises events of
    controls.lib.events.Event in `CarState.events`; their names are in the module's docstring.
    """

    def __init__(self, params: CarParams | None = None) -> None:
        self.params = params or get_params()

    def update(self, frames: Sequence[CanFrame], t: float) -> CarState:
        """Take all frames received since the last call at time `t` (s); returns a new CarState."""
        raise NotImplementedError

    def apply(self, control: CarControl, frame: int) -> list[CanFrame]:
        """Limit and pack the demand of control cycle `frame` (0, 1, ...); returns frames to send.

        Steering is sent every cycle, gas and brake every second, the dashboard every tenth.
        With `control.enabled` False all actuators are sent as zero, whatever the demand.
        """
        raise NotImplementedError
