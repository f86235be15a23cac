"""plannerd: plans speed and path from leads, set speed and road."""

from selfdrive.common.car import CarParams
from selfdrive.common.conversions import KPH_TO_MS
from selfdrive.common.realtime import DT_CTRL
from selfdrive.controls.lib.cruise_plan import cruise_limits, is_following
from selfdrive.controls.lib.events import IMMEDIATE_DISABLE, NO_ENTRY, Event
from selfdrive.controls.lib.fcw import FcwChecker
from selfdrive.controls.lib.long_mpc import LongitudinalMpc
from selfdrive.controls.lib.longcontrol import MIN_CAN_SPEED, PID, STARTING, STOPPING
from selfdrive.controls.lib.pathplanner import ModelFit, PathPlanner
from selfdrive.controls.lib.speed_smoother import smooth_speed
from selfdrive.messages import CarState, ModelData, Plan, RadarState

DT_PLAN = 0.2  # s, plan time at which the candidates are compared
MAX_AGE = 0.5  # s, older messages are ignored
AGE_ROUNDING = 1e-6  # s, for rounding in sums of 0.01

MODEL_ERROR = Event("model_error", (NO_ENTRY, IMMEDIATE_DISABLE))
RADAR_ERROR = Event("radar_error", (NO_ENTRY, IMMEDIATE_DISABLE))


class Planner:
    """Replans with each radar state (20 Hz) and interpolates in between (100 Hz)."""

    def __init__(self, params: CarParams, fit: ModelFit) -> None:
        self._params = params
        self.path = PathPlanner(fit)
        self.mpc1 = LongitudinalMpc(1)
        self.mpc2 = LongitudinalMpc(2, self.mpc1.solver)
        self._fcw_checker = FcwChecker()
        self._radar: RadarState | None = None
        self._model: ModelData | None = None
        self._fcw = False
        self._source = "cruise"
        self._planned_at = 0.0  # s
        # speed and acceleration: at the start of the plan, 0.2 s later, and now
        self._v_start = self._a_start = 0.0
        self._v_goal = self._a_goal = 0.0
        self._v_now = self._a_now = 0.0
        self._v_cruise = self._a_cruise = 0.0
        self._v_future = 0.0

    def take_model(self, v_ego: float, model: ModelData | None) -> bool:
        if model is None or model is self._model:
            return False
        self._model = model
        self.path.update(v_ego, model)
        return True

    def update(
        self,
        t: float,
        car: CarState,
        radar: RadarState | None,
        long_state: str,
        v_cruise: float,
        slow_down: bool,
    ) -> Plan:
        """Return the plan for this cycle at time `t` (s).

        `v_cruise` is the set speed in km/h; `slow_down` requests a gentle deceleration because the driver is
        absent.
        """
        if radar is not None and radar is not self._radar:
            self._radar = radar
            self._replan(t, car, radar, long_state, v_cruise * KPH_TO_MS, slow_down)
        self._interpolate(t)
        return Plan(
            t,
            self._v_now,
            self._a_now,
            self._v_future,
            self._source,
            self.mpc1.prev_lead_status,
            self._fcw,
            self.path.d_poly,
            self.path.lane_width,
            self._errors(t),
        )

    def _replan(
        self, t: float, car: CarState, radar: RadarState, long_state: str, v_set: float, slow_down: bool
    ) -> None:
        self._planned_at = t
        self._v_start, self._a_start = self._v_now, self._a_now
        enabled = long_state in (PID, STOPPING)
        if enabled:
            self._plan_cruise(car, radar, v_set, slow_down)
        else:
            self._follow_car(car, long_state)
        for mpc, lead in ((self.mpc1, radar.lead_one), (self.mpc2, radar.lead_two)):
            mpc.set_cur_state(self._v_start, self._a_start)
            mpc.update(car.v_ego, car.a_ego, lead)
        if enabled:
            self._choose()
        self._v_future = min(self.mpc1.v_mpc_future, self.mpc2.v_mpc_future, v_set)
        if self.mpc1.new_lead:
            self._fcw_checker.reset()
        warn = self._fcw_checker.update(t, car, radar.lead_one, self.mpc1.a_plan)
        self._fcw = warn and not car.brake_pressed

    def _plan_cruise(self, car: CarState, radar: RadarState, v_set: float, slow_down: bool) -> None:
        a_lateral = car.v_ego**2 * car.steering_angle / (self._params.steer_ratio * self._params.wheelbase)
        following = is_following(car.v_ego, radar.lead_one)
        limits = cruise_limits(car.v_ego, following, a_lateral, slow_down)
        v, self._a_cruise = smooth_speed(self._v_start, self._a_start, v_set, limits, DT_PLAN)
        self._v_cruise = max(v, 0.0)

    def _follow_car(self, car: CarState, long_state: str) -> None:
        """Start the plan at the car's state, because the control loop is open."""
        if long_state == STARTING:
            v, a = MIN_CAN_SPEED, self._params.start_acceleration
        else:
            v, a = car.v_ego, min(car.a_ego, 0.0)
        self._v_start = self._v_goal = self._v_now = self._v_cruise = v
        self._a_start = self._a_goal = self._a_now = self._a_cruise = a

    def _choose(self) -> None:
        self._source, self._v_goal, self._a_goal = "cruise", self._v_cruise, self._a_cruise
        for name, mpc in (("mpc1", self.mpc1), ("mpc2", self.mpc2)):
            if mpc.prev_lead_status and mpc.v_mpc < self._v_goal:
                self._source, self._v_goal, self._a_goal = name, mpc.v_mpc, mpc.a_mpc

    def _interpolate(self, t: float) -> None:
        """Set speed and acceleration planned for the next cycle. Past the plan's end, they stay constant."""
        dt = min(t - self._planned_at, DT_PLAN + DT_CTRL) + DT_CTRL
        self._a_now = self._a_start + dt / DT_PLAN * (self._a_goal - self._a_start)
        self._v_now = self._v_start + dt * (self._a_now + self._a_start) / 2.0

    def _errors(self, t: float) -> tuple[Event, ...]:
        oldest = t - MAX_AGE - AGE_ROUNDING
        model_lost = self._model is None or self._model.t < oldest
        radar_lost = self._radar is None or self._radar.t < oldest or bool(self._radar.errors)
        if model_lost:
            return (MODEL_ERROR, RADAR_ERROR) if radar_lost else (MODEL_ERROR,)
        return (RADAR_ERROR,) if radar_lost else ()
