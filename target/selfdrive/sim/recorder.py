"""Records a run: one row of channels per step, and the alerts."""

from array import array

import numpy as np

from selfdrive.manager import Manager
from selfdrive.messages import Actuators, LeadData
from selfdrive.sim.truth import GroundTruth

# Alerts treated as warnings, in the order of their bits in channel `alert`. As in the original, the last one,
# a refusal to engage, is among them.
COUNTED_ALERTS = (
    *("steer_saturated", "fcw", "can_error", "radar_error", "model_error"),
    "model_error_no_entry",
)
PLAN_SOURCES = ("cruise", "mpc1", "mpc2")
LONG_STATES = ("off", "pid", "stopping", "starting")
_PLAN_SOURCE_CODES = {name: float(code) for code, name in enumerate(PLAN_SOURCES)}
_LONG_STATE_CODES = {name: float(code) for code, name in enumerate(LONG_STATES)}

# Ground truth and actuators, then the controller's perception and demands. SI units, radians.
CHANNELS = (
    *("t", "v_ego", "a_ego", "d_rel", "v_rel", "v_lead", "hwt"),
    *("gas", "brake", "steer_torque", "steer_angle", "lateral_offset", "heading"),
    *("lead_status", "lead_d_rel", "lead_v_rel", "lead_v_lead_k", "lead_a_lead_k"),
    *("v_ego_est", "a_ego_est", "v_cruise", "v_pid", "v_target", "a_target", "angle_desired"),
    *("plan_source", "long_state", "engaged", "alert"),
)
INTEGER_CHANNELS = ("lead_status", "plan_source", "long_state", "engaged", "alert")

_NO_LEAD = LeadData()
_MOST_BUFFERED_NUMBERS = 64 * len(CHANNELS)  # numbers buffered by row before they move to channels
_FIRST_CAPACITY = 4096  # initial capacity in rows


class TraceRecorder:
    """The rows of `CHANNELS` and the alerts. Row k is the state after step k.

    `lead` and `alert_bits` (one bit for each of `COUNTED_ALERTS`) are those of the newest row. `was_engaged`
    says whether the controller has been engaged so far.
    """

    def __init__(self) -> None:
        self.alerts: list[tuple[str, float]] = []  # each time an alert is raised
        self.engaged_from: float | None = None
        self.engaged_to: float | None = None
        self.was_engaged = False
        self._rows = array("d")  # the newest rows, at least one
        self._earlier_rows = np.empty((len(CHANNELS), _FIRST_CAPACITY))  # earlier rows, by channel
        self._rows_in_table = 0  # rows in the table
        self._alerts_before: tuple[str, ...] = ()
        self.alert_bits = 0
        self.lead = _NO_LEAD

    def append(self, truth: GroundTruth, actuators: Actuators, manager: Manager) -> None:
        state, plan, radar_state = manager.controlsd.state, manager.controlsd.plan, manager.radar_state
        lead = self.lead = radar_state.lead_one if radar_state else _NO_LEAD
        t, d_rel, v_ego, v_lead = truth.t, truth.d_rel, truth.v_ego, truth.v_lead
        if state.alerts != self._alerts_before:
            self._note_alerts(state.alerts, t)
        if state.enabled:
            self.engaged_to = t
            if not self.was_engaged:
                self.was_engaged, self.engaged_from = True, t
        if len(self._rows) >= _MOST_BUFFERED_NUMBERS:
            self._move_rows_to_table()
        self._rows.fromlist(
            [
                *(t, v_ego, truth.a_ego, d_rel, v_lead - v_ego, v_lead),
                *(truth.hwt, actuators.gas, actuators.brake, actuators.steer),
                *(truth.steer_angle, truth.lateral_offset, truth.heading),
                *(lead.status, lead.d_rel, lead.v_rel, lead.v_lead_k, lead.a_lead_k),
                *(state.v_ego, state.a_ego, state.v_cruise, state.v_pid),
                *(plan.v_target, plan.a_target, state.angle_desired),
                *(_PLAN_SOURCE_CODES[plan.source], _LONG_STATE_CODES[state.long_state]),
                *(state.enabled, self.alert_bits),
            ]
        )

    def newest_row(self) -> dict[str, float]:
        return dict(zip(CHANNELS, self._rows[-len(CHANNELS) :], strict=True))

    def trace(self) -> dict[str, np.ndarray]:
        """The arrays by channel. Later rows do not change them."""
        count = self._rows_in_table + len(self._rows) // len(CHANNELS)
        table = self._with_newest()[:, :count]
        return {
            name: column.astype(np.int32) if name in INTEGER_CHANNELS else column
            for name, column in zip(CHANNELS, table, strict=True)
        }

    def _move_rows_to_table(self) -> None:
        self._earlier_rows = self._with_newest()
        self._rows_in_table += len(self._rows) // len(CHANNELS)
        del self._rows[:]

    def _with_newest(self) -> np.ndarray:
        newest = np.array(self._rows).reshape(-1, len(CHANNELS)).T
        table, end = self._earlier_rows, self._rows_in_table + newest.shape[1]
        if end > table.shape[1]:
            table = np.empty((len(CHANNELS), 2 * table.shape[1]))
            table[:, : self._rows_in_table] = self._earlier_rows[:, : self._rows_in_table]
        table[:, self._rows_in_table : end] = newest
        return table

    def _note_alerts(self, alerts: tuple[str, ...], t: float) -> None:
        self.alerts += [
            (name, t) for name in COUNTED_ALERTS if name in alerts and name not in self._alerts_before
        ]
        self.alert_bits = sum(1 << bit for bit, name in enumerate(COUNTED_ALERTS) if name in alerts)
        self._alerts_before = alerts
