"""The loop around a scripted controller: order, timing, record and trace."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from selfdrive.car.honda.hondacan import CommandPacker
from selfdrive.car.honda.values import CruiseButton
from selfdrive.messages import ControlsState, LeadData, Plan
from selfdrive.sim.recorder import CHANNELS, INTEGER_CHANNELS
from selfdrive.sim.scenario import load_scenario
from selfdrive.sim.simulator import Simulator


class Script:
    """Replaces the controller. It records its input and sends `commands(step)`."""

    def __init__(self, commands=lambda step: (0, 0, 0)):
        self.commands = commands
        self.steps = []
        self.packer = CommandPacker()
        self.controlsd = SimpleNamespace(state=ControlsState(), plan=Plan())
        self.radar_state = None

    def step(self, t, frames, view):
        self.steps.append((t, frames, view))
        step = len(self.steps) - 1
        torque, brake, gas = self.commands(step)
        return [
            self.packer.steering(torque, True, step),
            self.packer.brake(brake, True, False, False, False, step),
            self.packer.gas(gas, step),
        ]


@pytest.fixture
def s1(scenarios):
    return load_scenario(scenarios / "S1.yaml")


def drive(scenario, script, steps):
    simulator = Simulator()
    simulator.reset(scenario, 0)
    simulator.manager = script
    for _ in range(steps):
        simulator.step()
    return simulator


def test_a_command_acts_in_the_next_step(s1):
    """Row k of the trace shows the commands that are active in step k."""
    script = Script(lambda step: (-384, 51, 0) if step == 3 else (0, 0, 0))
    trace = drive(s1, script, 8).result().trace
    assert np.flatnonzero(trace["brake"]).tolist() == [4]
    assert trace["brake"][4] == 51 / 256
    assert trace["steer_torque"][4] == pytest.approx(0.1)
    assert np.flatnonzero(np.diff(trace["a_ego"]) < -0.5).tolist() == [3]
    assert np.flatnonzero(trace["steer_angle"])[0] == 4


def test_the_controller_gets_frames_every_step_and_views_every_fifth(s1):
    script = Script()
    drive(s1, script, 20)
    assert [t for t, _, _ in script.steps] == [k / 100 for k in range(20)]
    for k, (_, frames, view) in enumerate(script.steps):
        assert (view is not None) == (k % 5 == 0)
        assert ({0x400, 0x445} <= {f.address for f in frames if f.bus == 1}) == (k % 5 == 0)
        assert {0x158, 0x1D0, 0x14A, 0x296} <= {f.address for f in frames if f.bus == 0}


def test_buttons_reach_the_bus(s1):
    script = Script()
    drive(s1, script, 140)
    down = [
        k
        for k, (_, frames, _) in enumerate(script.steps)
        for f in frames
        if f.address == 0x296 and f.data[0] >> 5 == CruiseButton.DECEL_SET
    ]
    assert down == list(range(120, 130))


def test_a_coasting_car_agrees_with_openpilot(s1):
    """The expected values are those that openpilot's plant printed."""
    trace = drive(s1, Script(), 101).result().trace
    row = {name: trace[name][100] for name in ("d_rel", "v_rel", "v_ego", "a_ego", "hwt")}
    expected = {"d_rel": 91.058, "v_rel": -8.7637, "v_ego": 26.645, "a_ego": -0.17485, "hwt": 3.4174}
    assert row == pytest.approx(expected, abs=6e-4)
    assert trace["d_rel"][0] == pytest.approx(99.911, abs=6e-4)


def test_headway_time_at_standstill_is_infinite(s1):
    trace = drive(replace(s1, speed=0.0), Script(lambda step: (0, 255, 0)), 5).result().trace
    assert trace["v_ego"][-1] == 0.0
    assert np.isinf(trace["hwt"][-1])


def test_without_a_lead_sensors_report_an_object_200_m_ahead(s1):
    script = Script()
    result = drive(replace(s1, lead=None), script, 50).result()
    assert set(result.trace["d_rel"]) == {200.0}
    assert set(result.trace["v_rel"]) == {0.0}
    assert result.record["no_lead"] is True
    views = [view for _, _, view in script.steps if view]
    assert {view.lead_d_rel for view in views} == {200.0}
    tracks = {f.data for _, frames, _ in script.steps for f in frames if f.address == 0x445}
    assert tracks == {bytes.fromhex("c800000000000000")}


def test_the_record_has_hazards_and_alerts(s1):
    script = Script(lambda step: (0, 0, 1332))
    simulator = Simulator()
    simulator.reset(replace(s1, steps=1000), 7)
    simulator.manager = script
    while not simulator.is_finished:
        on = simulator.frame // 100 % 2 == 1
        script.controlsd.state = ControlsState(
            enabled=simulator.frame >= 131, alerts=("fcw", "startup") if on else ("startup",)
        )
        simulator.step()
    record = simulator.result().record
    trace = simulator.result().trace
    hit = trace["t"][np.argmax(trace["d_rel"] <= 0.0)]
    assert record["hazards"] == {"H1": hit, "H2": None, "H3": None, "H4": None}
    assert record["alerts"] == [{"name": "fcw", "t": 1.0}]
    assert [event["t"] for event in record["alert_events"]] == [1.0, 3.0, 5.0, 7.0, 9.0]
    assert (record["engaged_from"], record["engaged_to"]) == (1.31, 9.99)
    assert (record["seed"], record["steps"], record["scenario"]) == (7, 1000, "S1")
    assert np.unique(trace["alert"][100:200]).tolist() == [2]
    assert np.unique(trace["alert"][200:300]).tolist() == [0]


def test_every_channel_has_a_value_per_step(s1):
    script = Script()
    script.radar_state = SimpleNamespace(lead_one=LeadData(status=True, d_rel=50.0, v_lead_k=17.0))
    script.controlsd.plan = Plan(v_target=25.0, source="mpc2")
    script.controlsd.state = ControlsState(long_state="stopping")
    trace = drive(s1, script, 10).result().trace
    assert tuple(trace) == CHANNELS
    for name, values in trace.items():
        assert len(values) == 10
        assert values.dtype == (np.int32 if name in INTEGER_CHANNELS else np.float64)
    last = {name: values[-1] for name, values in trace.items()}
    assert (last["lead_status"], last["lead_d_rel"], last["lead_v_lead_k"]) == (1, 50.0, 17.0)
    assert (last["v_target"], last["plan_source"], last["long_state"]) == (25.0, 2, 2)


def test_a_result_can_be_taken_before_the_end(s1):
    simulator = drive(s1, Script(), 10)
    early = simulator.result()
    simulator.step()
    assert (early.record["steps"], len(early.trace["t"])) == (10, 10)
    assert simulator.result().record["steps"] == 11


def test_h4_needs_a_brake_command_beyond_full_brake(s1):
    """The brake message holds four times full brake, and the plant follows it; full brake alone is no H4."""
    for counts, first in ((256, None), (1000, 0.5)):
        script = Script(lambda step, counts=counts: (0, counts, 0))
        assert drive(s1, script, 80).result().record["hazards"]["H4"] == (
            first and pytest.approx(first, abs=0.05)
        )


def test_a_driver_brakes_beside_the_controller(s1):
    """The brake acts from the next step on, and the pedal is on the bus then."""
    script = Script()
    simulator = drive(s1, script, 20)
    simulator._actuators.extra_deceleration, simulator._actuators.brake_pedal = 6.0, 1.0
    simulator.step()
    simulator.step()
    braking = simulator.result().trace["a_ego"][-3:]
    assert braking == pytest.approx([-0.17, -6.17, -0.17], abs=0.02)
    pedals = [[f.data for f in frames if f.address == 380] for _, frames, _ in script.steps[-3:]]
    assert pedals[0][0][4:7] != pedals[1][0][4:7]
    assert pedals[0][0][:1] == pedals[1][0][:1]
