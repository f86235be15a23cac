"""The recorder stores one row for each step."""

from types import SimpleNamespace

import numpy as np
import pytest
from selfdrive.messages import Actuators
from selfdrive.sim.recorder import CHANNELS, TraceRecorder

TRUTH = ("t", "v_ego", "a_ego", "d_rel", "v_lead", "hwt", "steer_angle", "lateral_offset", "heading")


def make_recorder(rows: int) -> tuple[TraceRecorder, np.ndarray]:
    state = SimpleNamespace(
        **{"alerts": (), "enabled": True, "long_state": "pid", "angle_desired": 0.5},
        **dict.fromkeys(("v_ego", "a_ego", "v_cruise", "v_pid"), 1.5),
    )
    plan = SimpleNamespace(v_target=2.0, a_target=3.0, source="mpc1")
    manager = SimpleNamespace(controlsd=SimpleNamespace(state=state, plan=plan), radar_state=None)
    recorder, values = TraceRecorder(), np.random.default_rng(1).normal(size=(rows, 2))
    for t, heading in values.tolist():
        truth = SimpleNamespace(**dict.fromkeys(TRUTH, 0.25) | {"t": t, "heading": heading})
        recorder.append(truth, Actuators(), manager)
    return recorder, values


@pytest.mark.parametrize("rows", [0, 1, 63, 64, 65, 129, 4096, 4097, 8300])
def test_every_row_is_in_the_trace(rows):
    recorder, values = make_recorder(rows)
    trace = recorder.trace()
    assert tuple(trace) == CHANNELS
    assert np.array_equal(trace["t"], values[:, 0]) and np.array_equal(trace["heading"], values[:, 1])
    assert trace["plan_source"].dtype == np.int32 and (trace["plan_source"] == 1).all()
    if rows:
        assert recorder.newest_row() == {name: channel[-1] for name, channel in trace.items()}


def test_later_rows_do_not_change_a_trace():
    recorder, values = make_recorder(100)
    trace = recorder.trace()
    others, _ = make_recorder(100)
    recorder._rows.extend(others._rows)
    recorder._move_rows_to_table()
    assert np.array_equal(trace["t"], values[:, 0])
    assert len(recorder.trace()["t"]) == 136
