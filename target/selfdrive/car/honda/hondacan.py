"""The frames that the controller sends to the car."""

from selfdrive.can.dbc import load_dbc
from selfdrive.can.packer import MessagePacker
from selfdrive.car.honda.values import BRAKE_COUNTS, CAR_BUS, CAR_DBC
from selfdrive.messages import CanFrame


class CommandPacker:
    """Packs commands in counts."""

    def __init__(self) -> None:
        messages = load_dbc(CAR_DBC)

        def packer(name: str, *signals: str) -> MessagePacker:
            return MessagePacker(messages[name], signals, CAR_BUS)

        self._steering = packer("STEERING_CONTROL", "STEER_TORQUE", "STEER_TORQUE_REQUEST")
        self._brake = packer(
            "BRAKE_COMMAND",
            *("COMPUTER_BRAKE", "COMPUTER_BRAKE_REQUEST", "BRAKE_PUMP_REQUEST", "BRAKE_LIGHTS"),
            *("CRUISE_OVERRIDE", "CRUISE_CANCEL_CMD", "FCW", "CHIME"),
        )
        self._gas = packer("GAS_COMMAND", "GAS_COMMAND", "GAS_COMMAND2", "ENABLE")
        self._cruise_display = packer("ACC_HUD", "CRUISE_SPEED", "HUD_LEAD", "ENABLE_MINI_CAR")
        self._lane_display = packer("LKAS_HUD", "SOLID_LANES", "STEERING_REQUIRED", "BEEP")

    def steering(self, torque: int, active: bool, counter: int) -> CanFrame:
        """Torque in counts, right positive."""
        return self._steering.pack((torque, active), counter)

    def brake(
        self, counts: int, override: bool, cancel: bool, warning: bool, chime: bool, counter: int
    ) -> CanFrame:
        """Brake in counts of 1/256. `override` keeps the car's own cruise control off the pedals."""
        braking = counts > 0
        values = (counts / BRAKE_COUNTS, braking, braking, braking, override, cancel, 2 * warning, chime)
        return self._brake.pack(values, counter)

    def gas(self, counts: int, counter: int) -> CanFrame:
        """Gas in counts of the pedal interceptor; 0 switches it off."""
        return self._gas.pack((counts, counts, counts > 0), counter)

    def cruise_display(self, speed_kph: int, lead: int, mini_car: bool, counter: int) -> CanFrame:
        """Set speed (255: none); `lead` is 0 for no lead car, 1 dashed, 2 solid."""
        return self._cruise_display.pack((speed_kph, lead, mini_car), counter)

    def lane_display(self, lanes: bool, steering_required: bool, beep: bool, counter: int) -> CanFrame:
        return self._lane_display.pack((lanes, steering_required, beep), counter)
