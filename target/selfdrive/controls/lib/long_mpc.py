"""Longitudinal model-predictive control: how to follow one lead vehicle."""

from selfdrive.messages import LeadData


class LongitudinalMpc:
    """Plans the host's speed behind one lead; one real-time iteration an update (20 Hz).

    Call `set_cur_state` with the plan's speed and acceleration now, then `update`. Results:
    `v_mpc`, `a_mpc` (m/s, m/s^2, 0.2 s ahead), `v_mpc_future` (m/s, 4 s ahead), `prev_lead_status`
    (the solution is for a real lead and may compete for the plan), `new_lead` (the lead appeared or
    jumped in this update), `v_plan`, `a_plan`, `x_plan`, `x_lead_plan` (21 nodes, 0..10 s: every 0.2 s
    to 1 s, then every 0.6 s), and `resets`, the number of times a solution was thrown away.
    """

    def __init__(self, mpc_id: int, solver=None) -> None:
        """`mpc_id` is 1 or 2, for the log. Instances may share a `solver`: it keeps nothing between calls."""
        self.mpc_id = mpc_id
        self.v_mpc = 0.0
        self.a_mpc = 0.0
        self.v_mpc_future = 0.0
        self.prev_lead_status = False
        self.new_lead = False
        self.resets = 0
        self.v_plan: tuple[float, ...] = (0.0,) * 21
        self.a_plan: tuple[float, ...] = (0.0,) * 21
        self.x_plan: tuple[float, ...] = (0.0,) * 21
        self.x_lead_plan: tuple[float, ...] = (0.0,) * 21
        self.solver = solver

    def reset(self) -> None:
        """Back to the state after construction, without building the solver again."""
        raise NotImplementedError

    def set_cur_state(self, v: float, a: float) -> None:
        """Where the plan starts: speed (m/s) and acceleration (m/s^2)."""
        raise NotImplementedError

    def update(self, v_ego: float, a_ego: float, lead: LeadData | None) -> None:
        """Plan for `lead` (None or status False: no lead). `v_ego`, `a_ego`: the car's own."""
        raise NotImplementedError
