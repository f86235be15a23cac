"""Longitudinal model-predictive control: follows one lead vehicle.

Problem, rules and constants are those of openpilot v0.4.2.
"""

from array import array
from operator import sub

from selfdrive.controls.lib.compiled_mpc import build_longitudinal
from selfdrive.controls.lib.horizon import INTERVALS, LONGITUDINAL_STEP, N_NODES
from selfdrive.controls.lib.mpc_iteration import Iteration, Solver
from selfdrive.messages import LeadData

NODE_STEPS = tuple(LONGITUDINAL_STEP * n for n, _ in INTERVALS)  # s
FUTURE_NODE = 10  # 4 s ahead

LEAD_DECAY = 1.5  # 1/s, rate at which a lead's acceleration fades
LEAD_DECAY_FACTOR = 0.9  # per update, while the lead accelerates or brakes
LEAD_STEADY_ACCEL = 0.5  # m/s^2; less is treated as zero
LEAD_STOPPED_SPEED = 0.1  # m/s
LEAD_JUMP = 2.5  # m between updates; more means a different car
NO_LEAD_GAP, NO_LEAD_SPEED = 50.0, 10.0  # m, m/s faster than the host: a lead without influence
CHECKED_NODES = slice(1, 20)  # nodes whose gap and speed are checked: 0.2..9.4 s, as in the original
CRASH_GAP = -50.0  # m
BACKWARDS_SPEED = -0.01  # m/s


class LongitudinalMpc:
    """Plans the host's speed behind one lead; one real-time iteration per update (20 Hz).

    Call `set_cur_state` with the plan's current speed and acceleration, then `update`. Results: `v_mpc`,
    `a_mpc` (m/s, m/s^2, 0.2 s ahead), `v_mpc_future` (m/s, 4 s ahead), `prev_lead_status` (whether the
    solution is for a real lead and can become the plan), `new_lead` (whether the lead appeared or jumped in
    this update), `v_plan`, `a_plan`, `x_plan`, `x_lead_plan` (21 nodes, 0..10 s: every 0.2 s to 1 s, then
    every 0.6 s), and `resets` (the number of discarded solutions).

    A solution is discarded if it is not finite or if, for a real lead, it passes 50 m through the lead or
    drives backwards between 0.2 and 9.4 s. Then `v_mpc` and `a_mpc` are the car's, and the next update
    restarts with a new lead.

    v >= 0 is required at all nodes except the first, where it can be slightly negative, as in the original at
    the end of a stop. Jerk has no limit, so the problem is always feasible. If the solver still fails, the
    previous jerk is kept, `unsolved` is incremented, and the result is checked as above.
    """

    def __init__(self, mpc_id: int, solver: Solver | None = None) -> None:
        """`mpc_id` is 1 or 2. Instances can share a `solver`, which is stateless."""
        self.mpc_id = mpc_id
        self.solver = solver or build_longitudinal()
        self._iteration = Iteration(self.solver)
        self.reset()

    def reset(self) -> None:
        self._iteration.restart()
        self._v_start = self._a_start = 0.0
        self._decay = LEAD_DECAY
        self._prev_x_lead = 0.0
        self.prev_lead_status = self.new_lead = False
        self.resets = self._iteration.unsolved = 0
        self._publish(self._iteration.guess)

    @property
    def unsolved(self) -> int:
        return self._iteration.unsolved

    def set_cur_state(self, v: float, a: float) -> None:
        """Set the plan's start: speed (m/s) and acceleration (m/s^2)."""
        self._v_start, self._a_start = v, a

    def update(self, v_ego: float, a_ego: float, lead: LeadData | None) -> None:
        """Plan for `lead` (None or status False: no lead). `v_ego` and `a_ego` are the car's."""
        self.new_lead = False
        if lead is not None and lead.status:
            x_lead, v_lead, a_lead, decay = self._follow(lead)
        else:
            self.prev_lead_status = False
            x_lead, v_lead, a_lead, decay = NO_LEAD_GAP, v_ego + NO_LEAD_SPEED, 0.0, LEAD_DECAY
        start = (0.0, self._v_start, self._a_start, x_lead, v_lead, a_lead)
        self._iteration.guess[:6] = array("d", start)  # the original linearises here too
        finite = self._iteration.run(start, (decay,))
        if finite:
            self._publish(self._iteration.solution)
        if not finite or (self.prev_lead_status and self._runs_into_lead()):
            self._discard(v_ego, a_ego)

    def _follow(self, lead: LeadData) -> tuple[float, float, float, float]:
        x, v, a = lead.d_rel, max(0.0, lead.v_lead), lead.a_lead_k
        if v < LEAD_STOPPED_SPEED or -a / 2 > v:  # stopped, or soon will be
            v = a = 0.0
        self._decay = LEAD_DECAY if abs(a) < LEAD_STEADY_ACCEL else self._decay * LEAD_DECAY_FACTOR
        decay = max(self._decay, -a / (v + 0.01))  # a braking lead stops but does not reverse
        if not self.prev_lead_status or abs(x - self._prev_x_lead) > LEAD_JUMP:
            self._simulate(x, v, a, decay)
            self.new_lead = True
        self.prev_lead_status = True
        self._prev_x_lead = x
        return x, v, a, decay

    def _simulate(self, x_lead: float, v_lead: float, a_lead: float, decay: float) -> None:
        """Guess a first plan for a new lead: the host brakes evenly to the lead's speed within the gap."""
        x, v, a = 0.0, self.v_mpc, 0.0
        room = 2 * x_lead + 0.01
        if v > v_lead and room != 0.0:
            a = a_lead - (v - v_lead) * (v - v_lead) / room
        nodes: list[float] = []
        for dt in (*NODE_STEPS, 0.0):
            nodes += (x, v, a, x_lead, v_lead, a_lead)
            x += v * dt
            v += a * dt
            x_lead += v_lead * dt
            v_lead += a_lead * dt
            a_lead -= decay * a_lead * dt
            if v <= 0.0:
                v = a = 0.0
        self._iteration.restart(nodes)

    def _publish(self, z: array) -> None:
        end = 6 * N_NODES
        self.x_plan, self.v_plan, self.a_plan = z[0:end:6], z[1:end:6], z[2:end:6]
        self.x_lead_plan = z[3:end:6]
        self.v_mpc, self.a_mpc = self.v_plan[1], self.a_plan[1]
        self.v_mpc_future = self.v_plan[FUTURE_NODE]

    def _runs_into_lead(self) -> bool:
        gap = min(map(sub, self.x_lead_plan[CHECKED_NODES], self.x_plan[CHECKED_NODES]))
        return gap < CRASH_GAP or min(self.v_plan[CHECKED_NODES]) < BACKWARDS_SPEED

    def _discard(self, v_ego: float, a_ego: float) -> None:
        self.resets += 1
        self._iteration.restart()
        self.v_mpc, self.a_mpc = v_ego, a_ego
        self.prev_lead_status = False
