"""Longitudinal control: from target speed and acceleration to gas and brake."""

from selfdrive.common.car import CarParams
from selfdrive.common.interp import clip, interp
from selfdrive.common.realtime import DT_CTRL
from selfdrive.controls.lib.pid import PIController
from selfdrive.messages import CarState, Plan

OFF = "off"
PID = "pid"  # closed loop
STOPPING = "stopping"  # open-loop braking, because the closed loop works badly near standstill
STARTING = "starting"  # open-loop release of the brake

MIN_CAN_SPEED = 0.3  # m/s, below this the car reports 0
STOPPING_EGO_SPEED = 0.5  # m/s
STOPPING_TARGET_SPEED = MIN_CAN_SPEED + 0.01  # m/s
STARTING_TARGET_SPEED = 0.5  # m/s
STOPPING_BRAKE_RATE = 0.2  # 1/s
STOPPING_BRAKE = 0.5  # enough to hold the car
STARTING_BRAKE_RATE = 0.8  # 1/s
STARTED_BRAKE = 0.2  # below this brake, the closed loop takes over

CREEP_SPEED = 2.3  # m/s; below this, an idling car creeps forward
CREEP_BRAKE = 0.15  # brake that holds an idling car at rest


class LongControl:
    """Gas and brake as one output in -1..1, including the states around standstill."""

    def __init__(self, params: CarParams) -> None:
        self._params = params
        self._pid = PIController(params.long_kp, params.long_ki, convert=self._to_output)
        self.state = OFF
        self.v_pid = 0.0
        self.output = 0.0

    def reset(self, v_pid: float) -> None:
        """Restart from the speed `v_pid` (m/s)."""
        self._pid.reset()
        self.v_pid = v_pid

    def update(self, active: bool, car: CarState, plan: Plan) -> tuple[float, float]:
        """Run one cycle; return gas and brake, each in 0..1."""
        gas_max = interp(car.v_ego, *self._params.gas_max)
        brake_max = interp(car.v_ego, *self._params.brake_max)
        self.state = self._next_state(active, car, plan.v_target_future)
        if self.state == PID:
            self._follow(car, plan, gas_max, brake_max)
        elif self.state == STOPPING:
            self._stop(car, gas_max, brake_max)
        elif self.state == STARTING:
            self._start(car)
        else:
            self._pid.reset()
            self.v_pid = max(car.v_ego, MIN_CAN_SPEED)
            self.output = 0.0
        return clip(self.output, 0.0, gas_max), -clip(self.output, -brake_max, 0.0)

    def _next_state(self, active: bool, car: CarState, v_future: float) -> str:
        if not active:
            return OFF
        target_is_stop = self.v_pid < STOPPING_TARGET_SPEED and v_future < STOPPING_TARGET_SPEED
        stop = car.v_ego < STOPPING_EGO_SPEED and (target_is_stop or car.brake_pressed)
        if self.state == OFF:
            return PID
        if self.state == PID:
            return STOPPING if stop else PID
        if self.state == STOPPING:
            return STARTING if v_future > STARTING_TARGET_SPEED else STOPPING
        if stop:
            return STOPPING
        return PID if self.output >= -STARTED_BRAKE else STARTING

    def _follow(self, car: CarState, plan: Plan, gas_max: float, brake_max: float) -> None:
        self.v_pid = plan.v_target
        self._pid.pos_limit = gas_max
        self._pid.neg_limit = -brake_max
        v_ego = max(car.v_ego, MIN_CAN_SPEED)  # below this the car reports 0
        self.output = self._pid.update(self.v_pid, v_ego, speed=v_ego, feedforward=plan.a_target)

    def _stop(self, car: CarState, gas_max: float, brake_max: float) -> None:
        if not car.standstill or self.output > -STOPPING_BRAKE:
            self.output -= STOPPING_BRAKE_RATE * DT_CTRL
        self.output = clip(self.output, -brake_max, gas_max)
        self.reset(car.v_ego)

    def _start(self, car: CarState) -> None:
        if self.output < -STARTED_BRAKE:
            self.output += STARTING_BRAKE_RATE * DT_CTRL
        self.reset(car.v_ego)

    def _to_output(self, acceleration: float, speed: float) -> float:
        """Convert acceleration (m/s^2) to output, including the brake that prevents creeping."""
        creep = (CREEP_SPEED - speed) / CREEP_SPEED * CREEP_BRAKE if speed < CREEP_SPEED else 0.0
        return acceleration / self._params.acceleration_per_output - creep
