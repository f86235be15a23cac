"""Converts the controller's demand to commands for the Civic's actuators."""

from math import isfinite

from selfdrive.car.honda.hondacan import CommandPacker
from selfdrive.car.honda.values import BRAKE_COUNTS, PEDAL_COUNTS, PEDAL_REST_COUNTS, STEER_COUNTS
from selfdrive.common.conversions import MS_TO_KPH
from selfdrive.common.interp import clip
from selfdrive.common.realtime import DT_CTRL
from selfdrive.messages import CanFrame, CarControl, CarState

BRAKE_ON = 0.02  # a demand of at least this much starts braking
BRAKE_OFF = 0.005  # below this, braking ends
BRAKE_HYSTERESIS_GAP = 0.01  # smaller changes of the demand are ignored
MOST_BRAKE_RISE_PER_STEP = 1.0 * DT_CTRL  # per cycle; the brake can drop immediately

STEPS_PER_PEDAL_FRAMES = 2  # cycles
STEPS_PER_DISPLAY_FRAMES = 10  # cycles


class BrakeHysteresis:
    """Prevents brake chatter with different thresholds for on and off, and by ignoring small changes."""

    def __init__(self) -> None:
        self._braking = False
        self._steady = 0.0

    def update(self, brake: float) -> float:
        if brake < BRAKE_OFF or (brake < BRAKE_ON and not self._braking):
            brake = 0.0
        self._braking = brake > 0.0
        if not self._braking:
            self._steady = 0.0
        elif brake > self._steady + BRAKE_HYSTERESIS_GAP:
            self._steady = brake - BRAKE_HYSTERESIS_GAP
        elif brake < self._steady - BRAKE_HYSTERESIS_GAP:
            self._steady = brake + BRAKE_HYSTERESIS_GAP
        return self._steady


class CarController:
    """Applies limits, hysteresis and rate limits, and packs the result. One instance per run."""

    def __init__(self) -> None:
        self._hysteresis = BrakeHysteresis()
        self._brake = 0.0
        self._can = CommandPacker()

    def update(self, control: CarControl, car: CarState, frame: int) -> list[CanFrame]:
        """Return the frames of control cycle `frame`. A NaN demand is sent as zero."""
        demand = control.actuators
        enabled = control.enabled
        gas = _finite_or_zero(demand.gas) if enabled else 0.0
        steer = _finite_or_zero(demand.steer) if enabled else 0.0
        brake = self._hysteresis.update(_finite_or_zero(demand.brake) if enabled else 0.0)
        self._brake = min(brake, self._brake + MOST_BRAKE_RISE_PER_STEP)

        active = enabled and not car.steer_not_allowed
        torque = int(clip(-steer, -1.0, 1.0) * STEER_COUNTS) if active else 0
        frames = [self._can.steering(torque, active, frame)]
        if frame % STEPS_PER_PEDAL_FRAMES == 0:
            frames += self._pedals(control, car, gas, frame // STEPS_PER_PEDAL_FRAMES)
        if frame % STEPS_PER_DISPLAY_FRAMES == 0:
            frames += self._display(control, frame // STEPS_PER_DISPLAY_FRAMES)
        return frames

    def _pedals(self, control: CarControl, car: CarState, gas: float, counter: int) -> list[CanFrame]:
        brake_counts = int(clip(self._brake * BRAKE_COUNTS, 0, BRAKE_COUNTS - 1))
        gas_counts = int(min(gas, 1.0) * PEDAL_COUNTS) + PEDAL_REST_COUNTS if gas > 0.0 else 0
        cancel = control.cancel_cruise or (car.cruise_enabled and not control.enabled)
        fcw = control.visual_alert == "fcw"
        chime = control.audible_alert != "none"
        return [
            self._can.brake(brake_counts, control.enabled, cancel, fcw, chime, counter),
            self._can.gas(gas_counts, counter),
        ]

    def _display(self, control: CarControl, counter: int) -> list[CanFrame]:
        speed_kph = round(control.set_speed * MS_TO_KPH) if control.speed_visible else 255
        lead = (2 if control.lead_visible else 1) if control.enabled else 0
        steering_required = control.visual_alert == "steer_required"
        beep = control.audible_alert != "none"
        return [
            self._can.cruise_display(speed_kph, lead, control.enabled, counter),
            self._can.lane_display(control.lanes_visible, steering_required, beep, counter),
        ]


def _finite_or_zero(value: float) -> float:
    return value if isfinite(value) else 0.0
