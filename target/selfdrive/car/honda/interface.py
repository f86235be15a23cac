"""The Honda Civic Touring 2016 as the controller sees it: CAN in, CarState out; CarControl in, CAN out."""

from collections.abc import Sequence
from operator import attrgetter

from selfdrive.car.honda.carcontroller import CarController
from selfdrive.car.honda.carstate import CarStateReader
from selfdrive.common.car import CarParams
from selfdrive.common.conversions import RAD_TO_DEG
from selfdrive.controls.lib.events import (
    ENABLE,
    IMMEDIATE_DISABLE,
    NO_ENTRY,
    PERMANENT,
    PRE_ENABLE,
    SOFT_DISABLE,
    USER_DISABLE,
    WARNING,
    Event,
)
from selfdrive.messages import CanFrame, CarControl, CarState

CAN_ERROR_CYCLES = 5  # consecutive invalid cycles before can_error is raised

# The event that each condition of CarState raises.
_EVENT_OF_CONDITION = (
    ("steer_error", Event("steer_unavailable", (NO_ENTRY, IMMEDIATE_DISABLE, PERMANENT))),
    ("steer_not_allowed", Event("steer_temp_unavailable", (NO_ENTRY, WARNING))),
    ("brake_error", Event("brake_unavailable", (NO_ENTRY, IMMEDIATE_DISABLE, PERMANENT))),
    ("door_open", Event("door_open", (NO_ENTRY, SOFT_DISABLE))),
    ("seatbelt_unlatched", Event("seatbelt_not_latched", (NO_ENTRY, SOFT_DISABLE))),
    ("esp_disabled", Event("esp_disabled", (NO_ENTRY, SOFT_DISABLE))),
    ("brake_hold", Event("brake_hold", (NO_ENTRY, USER_DISABLE))),
    ("park_brake", Event("park_brake", (NO_ENTRY, USER_DISABLE))),
)
_condition_values = attrgetter(*(name for name, _ in _EVENT_OF_CONDITION))
_CAN_ERROR = Event("can_error", (NO_ENTRY, IMMEDIATE_DISABLE))
_WRONG_GEAR = Event("wrong_gear", (NO_ENTRY, SOFT_DISABLE))
_REVERSE_GEAR = Event("reverse_gear", (NO_ENTRY, IMMEDIATE_DISABLE))
_WRONG_CAR_MODE = Event("wrong_car_mode", (NO_ENTRY, USER_DISABLE))
_PEDAL_TAKES_OVER = Event("pedal_pressed", (NO_ENTRY, USER_DISABLE))
_PEDAL_HELD = Event("pedal_pressed", (PRE_ENABLE,))
_BUTTON_ENABLE = Event("button_enable", (ENABLE,))
_BUTTON_CANCEL = Event("button_cancel", (USER_DISABLE,))


def get_params() -> CarParams:
    """Physical data and tuning of the Civic; the lateral gains are the original's, converted from degrees to
    radians."""
    wheelbase = 2.70
    return CarParams(
        name="HONDA CIVIC 2016 TOURING",
        mass=1461.6,
        wheelbase=wheelbase,
        center_to_front=0.4 * wheelbase,
        steer_ratio=13.0,
        rotational_inertia=2500.0,
        tire_stiffness_front=85400.0,
        tire_stiffness_rear=90000.0,
        steer_kp=((0.0,), (0.8 * RAD_TO_DEG,)),
        steer_ki=((0.0,), (0.24 * RAD_TO_DEG,)),
        steer_kf=0.0,  # as in the original, which leaves it for later
        steer_max=1.0,
        steer_actuator_delay=0.1,
        steer_rate_cost=0.5,
        long_kp=((0.0, 5.0, 35.0), (3.6, 2.4, 1.5)),
        long_ki=((0.0, 35.0), (0.54, 0.36)),
        gas_max=((0.0,), (0.6,)),
        brake_max=((5.0, 20.0), (1.0, 0.8)),
        acceleration_per_output=4.8,
        radar_offset=2.7,
        steer_limit_alert=True,
    )


class CarInterface:
    """Reads and commands the car. One instance per run."""

    def __init__(self, params: CarParams | None = None) -> None:
        self.params = params or get_params()
        self._reader = CarStateReader()
        self._controller = CarController()
        self._car = CarState()
        self._invalid_cycles = 0

    def update(self, frames: Sequence[CanFrame], t: float) -> CarState:
        previous, car = self._car, self._reader.update(frames, t)
        self._invalid_cycles = 0 if car.can_valid else self._invalid_cycles + 1
        car.events = tuple(self._events(car, previous))
        self._car = car
        return car

    def apply(self, control: CarControl, frame: int) -> list[CanFrame]:
        return self._controller.update(control, self._car, frame)

    def _events(self, car: CarState, previous: CarState) -> list[Event]:
        events = []
        if any(_condition_values(car)):
            events = [event for name, event in _EVENT_OF_CONDITION if getattr(car, name)]
        if self._invalid_cycles >= CAN_ERROR_CYCLES:
            events.append(_CAN_ERROR)
        if car.gear != "drive":
            events.append(_REVERSE_GEAR if car.gear == "reverse" else _WRONG_GEAR)
        if not car.cruise_available:
            events.append(_WRONG_CAR_MODE)
        gas_trodden = car.gas_pressed and not previous.gas_pressed
        brake_trodden = car.brake_pressed and (not previous.brake_pressed or car.v_ego > 0.001)
        if gas_trodden or brake_trodden:
            events.append(_PEDAL_TAKES_OVER)
        if car.gas_pressed:
            events.append(_PEDAL_HELD)
        for button in car.buttons:
            if button.type in ("accel", "decel") and not button.pressed:
                events.append(_BUTTON_ENABLE)
            elif button.type == "cancel" and button.pressed:
                events.append(_BUTTON_CANCEL)
        return events
