"""Converts the Civic's CAN frames to a CarState."""

from collections.abc import Sequence

from selfdrive.can.dbc import load_dbc
from selfdrive.can.parser import CanParser
from selfdrive.car.honda.values import (
    CAR_BUS,
    CAR_DBC,
    CAR_MESSAGES,
    GEAR_NAME_BY_CODE,
    STEER_OVERRIDE_TORQUE,
    STEER_STATUS_NORMAL,
    STEER_STATUSES_WITHOUT_FAULT,
    CruiseButton,
)
from selfdrive.common.conversions import DEG_TO_RAD, KPH_TO_MS
from selfdrive.common.interp import interp
from selfdrive.common.kalman import SteadyKalman
from selfdrive.common.realtime import DT_CTRL
from selfdrive.messages import ButtonEvent, CanFrame, CarState

SPEED_KALMAN_GAINS = (0.12287673, 0.29666309)  # of the speed estimate's Kalman filter at 100 Hz

# The wheel sensors are too coarse at walking pace; the gearbox is used there.
_BLEND_BP = (1.0, 6.0)  # m/s
_BLEND_V = (0.0, 1.0)  # weight of the wheel speed

_BUTTON_NAMES = {
    CruiseButton.RES_ACCEL: "accel",
    CruiseButton.DECEL_SET: "decel",
    CruiseButton.CANCEL: "cancel",
}


class CarStateReader:
    """Reads the car bus.

    As in the original, the speed estimate starts at 0 whatever the car's speed, so it overshoots by 10 % in
    the first half second.
    """

    def __init__(self) -> None:
        self._parser = CanParser(load_dbc(CAR_DBC), CAR_MESSAGES, CAR_BUS)
        self._speed = SteadyKalman(0.0, 0.0, dt=DT_CTRL, gains=SPEED_KALMAN_GAINS)
        self._cruise_button = CruiseButton.NONE
        self._cruise_setting = 0
        self._brake_switch = False

    def update(self, frames: Sequence[CanFrame], t: float) -> CarState:
        self._parser.update(frames, t)
        state = CarState(t=t, can_valid=self._parser.valid)
        self._read_motion(state)
        self._read_driver(state)
        self._read_body(state)
        return state

    def _read_motion(self, state: CarState) -> None:
        values = self._parser.values
        front_left, front_right, rear_left, rear_right = values["WHEEL_SPEEDS"]
        wheels = (front_left + front_right + rear_left + rear_right) * (0.25 * KPH_TO_MS)
        gearbox = values["ENGINE_DATA"][0] * KPH_TO_MS
        weight = interp(wheels, _BLEND_BP, _BLEND_V)
        state.v_ego_raw = weight * wheels + (1.0 - weight) * gearbox
        self._speed.update(state.v_ego_raw)
        state.v_ego = self._speed.value
        state.a_ego = self._speed.rate
        moving, brake_error_1, brake_error_2 = values["STANDSTILL"]
        state.standstill = not moving
        state.brake_error = bool(brake_error_1 or brake_error_2)
        angle, rate = values["STEERING_SENSORS"]
        state.steering_angle = angle * DEG_TO_RAD
        state.steering_rate = rate * DEG_TO_RAD
        state.steering_torque, status = values["STEER_STATUS"]
        state.steering_pressed = abs(state.steering_torque) > STEER_OVERRIDE_TORQUE
        state.steer_not_allowed = status != STEER_STATUS_NORMAL
        state.steer_error = status not in STEER_STATUSES_WITHOUT_FAULT

    def _read_driver(self, state: CarState) -> None:
        values = self._parser.values
        pedal, cruise_enabled, brake_switch, brake_pressed = values["POWERTRAIN_DATA"]
        state.gas = pedal / 255.0
        state.gas_pressed = pedal > 0
        # the switch flickers for single frames; two in a row mean that the brake is pressed
        state.brake_pressed = bool(brake_pressed or (brake_switch and self._brake_switch))
        self._brake_switch = bool(brake_switch)
        state.cruise_enabled = bool(cruise_enabled)
        state.cruise_speed = values["CRUISE"][0] * KPH_TO_MS
        state.gear = GEAR_NAME_BY_CODE.get(values["GEARBOX"][0], "unknown")
        button, setting = values["SCM_BUTTONS"]
        if (button, setting) != (self._cruise_button, self._cruise_setting):
            state.buttons = tuple(self._button_events(button, setting))
            self._cruise_button, self._cruise_setting = button, setting

    def _button_events(self, button: int, setting: int) -> list[ButtonEvent]:
        events = []
        for code, pressed in ((self._cruise_button, False), (button, True)):
            if button != self._cruise_button and code in _BUTTON_NAMES:
                events.append(ButtonEvent(_BUTTON_NAMES[code], pressed))
        if setting != self._cruise_setting:
            events.append(ButtonEvent("setting", bool(setting)))
        return events

    def _read_body(self, state: CarState) -> None:
        values = self._parser.values
        main_on, left, right = values["SCM_FEEDBACK"]
        state.cruise_available = bool(main_on)
        state.left_blinker, state.right_blinker = bool(left), bool(right)
        lamp, latched = values["SEATBELT_STATUS"]
        state.seatbelt_unlatched = bool(lamp or not latched)
        state.door_open = any(values["DOORS_STATUS"])
        esp_disabled, brake_hold = values["VSA_STATUS"]
        state.esp_disabled = bool(esp_disabled)
        state.brake_hold = bool(brake_hold)
        state.park_brake = bool(values["EPB_STATUS"][0])
