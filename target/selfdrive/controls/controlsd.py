"""controlsd: the control loop, every 10 ms."""

from selfdrive.common.car import Car, CarParams
from selfdrive.common.conversions import KPH_TO_MS
from selfdrive.controls.lib.alertmanager import AlertManager
from selfdrive.controls.lib.angle_offset import AngleOffset
from selfdrive.controls.lib.cruise_speed import V_CRUISE_NONE, button_v_cruise, initial_v_cruise
from selfdrive.controls.lib.driver_awareness import DriverAwareness
from selfdrive.controls.lib.events import (
    IMMEDIATE_DISABLE,
    NO_ENTRY,
    PERMANENT,
    WARNING,
    Event,
    names_of_kind,
)
from selfdrive.controls.lib.latcontrol import LatControl
from selfdrive.controls.lib.longcontrol import STARTING_TARGET_SPEED, LongControl
from selfdrive.controls.lib.pathplanner import ModelFit
from selfdrive.controls.lib.state_machine import StateMachine
from selfdrive.controls.plannerd import Planner
from selfdrive.messages import (
    Actuators,
    CanFrame,
    CarControl,
    CarState,
    ControlsState,
    ModelData,
    Plan,
    RadarState,
)

NO_TARGET = Event("no_target", (NO_ENTRY, IMMEDIATE_DISABLE))
LEARN_EVERY, LEARN_AT = 5, 2  # cycles, angle offset learning at 20 Hz


class Controlsd:
    """The control loop. `state` and `plan` are those of the last update."""

    def __init__(self, params: CarParams, car: Car, fit: ModelFit) -> None:
        self._params = params
        self._car = car
        self._planner = Planner(params, fit)
        self._lateral = LatControl(params)
        self._longitudinal = LongControl(params)
        self._machine = StateMachine()
        self._alerts = AlertManager()
        self._awareness = DriverAwareness()
        self._angle_offset = AngleOffset()
        self._v_cruise = V_CRUISE_NONE  # km/h
        self._frame = 0
        self.state = ControlsState()
        self.plan = Plan()

    def update(
        self, t: float, frames: list[CanFrame], radar_state: RadarState | None, model: ModelData | None
    ) -> list[CanFrame]:
        """Run one cycle at time `t` (s) and return the frames to send.

        `radar_state` and `model` are the newest messages of any age, None before the first.
        """
        if self._frame == 0:
            self._alerts.add("startup", t)
        car = self._car.update(frames, t)
        self.plan = self._make_plan(t, car, radar_state, model)
        events = self._collect_events(car)
        self._transition(t, car, events)
        actuators = self._control(t, car, events)
        self._alerts.process(t)
        self.state = self._publish(t, car, events)
        sent = self._car.apply(self._car_control(actuators), self._frame)
        self._frame += 1
        return sent

    def _make_plan(
        self, t: float, car: CarState, radar_state: RadarState | None, model: ModelData | None
    ) -> Plan:
        """Plan in every state, so that a lead is known before the driver engages."""
        if self._planner.take_model(car.v_ego, model):
            self._lateral.plan(car, self._planner.path.lanes, self._angle_offset.value)
        state, absent = self._longitudinal.state, self._awareness.absent
        return self._planner.update(t, car, radar_state, state, self._v_cruise, absent)

    def _collect_events(self, car: CarState) -> tuple[Event, ...]:
        events = car.events + self.plan.events
        # brake pressed with nothing to stop for: releasing the pedal would start the car
        if car.brake_pressed and self.plan.v_target_future >= STARTING_TARGET_SPEED:
            events += (NO_TARGET,)
        return events

    def _transition(self, t: float, car: CarState, events: tuple[Event, ...]) -> None:
        if self._machine.enabled and car.buttons:
            self._v_cruise = button_v_cruise(self._v_cruise, car.buttons)
        if self._machine.update(events, self._alerts, t):
            self._v_cruise = initial_v_cruise(car.v_ego)

    def _control(self, t: float, car: CarState, events: tuple[Event, ...]) -> Actuators:
        active = self._machine.active
        if self.plan.fcw:
            self._alerts.add("fcw", t)
        if active:
            self._warn(t, events)
        self._learn(car, active)
        gas, brake = self._longitudinal.update(active, car, self.plan)
        steer = self._lateral.update(car, active)
        if not active or car.buttons or car.steering_pressed:
            self._awareness.reset()
        if self._lateral.saturated and self._params.steer_limit_alert:
            self._alerts.add("steer_saturated", t)
        if events:
            for name in names_of_kind(events, PERMANENT):
                self._alerts.add(name + "_permanent", t)
        return Actuators(gas, brake, steer)

    def _warn(self, t: float, events: tuple[Event, ...]) -> None:
        distracted = self._awareness.count_down()
        if distracted:
            self._alerts.add(distracted, t)
        if events:
            for name in names_of_kind(events, WARNING):
                self._alerts.add(name, t)

    def _learn(self, car: CarState, active: bool) -> None:
        if self._frame % LEARN_EVERY == LEARN_AT and active and not car.steering_pressed:
            path = self._planner.path
            self._angle_offset.update(car.v_ego, path.c_poly[3], path.c_prob, car.steering_angle)

    def _car_control(self, actuators: Actuators) -> CarControl:
        enabled = self._machine.enabled
        return CarControl(
            enabled,
            actuators,
            not enabled,  # cancels the car's own cruise control
            self._v_cruise * KPH_TO_MS,
            enabled,  # shows the set speed
            enabled,  # shows the lanes
            self.plan.has_lead,
            self._alerts.visual,
            self._alerts.audible,
        )

    def _publish(self, t: float, car: CarState, events: tuple[Event, ...]) -> ControlsState:
        machine, alerts = self._machine, self._alerts
        return ControlsState(  # positional arguments take half as long
            t,
            machine.state,
            machine.enabled,
            machine.active,
            car.v_ego,
            car.a_ego,
            car.steering_angle,
            self._lateral.angle_desired,
            self._v_cruise * KPH_TO_MS,
            self._longitudinal.v_pid,
            self._longitudinal.state,
            self._lateral.saturated,
            car.steering_pressed,
            alerts.active,
            alerts.text1,
            alerts.text2,
            tuple([event.name for event in events]),
        )
