"""The car's actuators, which decode the controller's frames."""

from collections.abc import Sequence

from selfdrive.can.dbc import load_dbc
from selfdrive.can.parser import CanParser
from selfdrive.car.honda.values import CAR_BUS, CAR_DBC, COMMAND_MESSAGES, STEER_FULL_COUNTS
from selfdrive.messages import Actuators, CanFrame

# The pedal interceptor's conversion of counts; 256 is full gas.
_PEDAL_SLOPE = 0.253984064
_PEDAL_OFFSET = -83.3
_PEDAL_FULL = 256.0


class ActuatorReceiver:
    """Decodes commands. Each actuator holds its last valid command."""

    def __init__(self) -> None:
        self._parser = CanParser(load_dbc(CAR_DBC), COMMAND_MESSAGES, CAR_BUS)

    def update(self, frames: Sequence[CanFrame], t: float) -> Actuators:
        """Return gas and brake in 0..1, and steering torque relative to the EPS's maximum, left positive."""
        self._parser.update(frames, t)
        values = self._parser.values
        torque, active = values["STEERING_CONTROL"]
        pedal = (values["GAS_COMMAND"][0] * _PEDAL_SLOPE + _PEDAL_OFFSET) / _PEDAL_FULL
        return Actuators(
            gas=max(pedal, 0.0),
            brake=values["BRAKE_COMMAND"][0],
            steer=-torque / STEER_FULL_COUNTS if active else 0.0,
        )
