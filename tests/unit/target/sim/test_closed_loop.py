"""The closed loop: fault-free scenarios, lost inputs, lane behaviour, repeatability."""

from dataclasses import replace

import numpy as np
import pytest
from selfdrive.sim.scenario import load_scenario
from selfdrive.sim.simulator import Simulator


def drive(scenario, change=lambda simulator: None, simulator=None):
    simulator = simulator or Simulator()
    simulator.reset(scenario, 0)
    change(simulator)
    while not simulator.is_finished:
        simulator.step()
    return simulator.result()


def contexts(trace):
    """Count the rows of the context table (HWT above 2 s or not, closing in or not) reached after 1.5 s."""
    armed = trace["t"] >= 1.5
    far, closing = trace["hwt"][armed] > 2.0, trace["v_rel"][armed] < 0.0
    return len(set(zip(far.tolist(), closing.tolist(), strict=True)))


@pytest.fixture
def s1(scenarios):
    return load_scenario(scenarios / "S1.yaml")


@pytest.mark.parametrize(("name", "rows"), [("S1", 3), ("S2", 4), ("S3", 4), ("S4", 4), ("S5", 3)])
def test_fault_free_runs_have_no_hazard_or_alert(fault_free, name, rows):
    record, trace = fault_free(name).record, fault_free(name).trace
    assert record["engaged_from"] == pytest.approx(1.31, abs=0.02)
    assert record["engaged_to"] == 29.99
    assert record["hazards"] == {"H1": None, "H2": None, "H3": None, "H4": None}
    assert record["alert_events"] == []
    assert np.abs(trace["lateral_offset"]).max() < 0.01
    assert trace["v_cruise"][-1] == pytest.approx(97 / 3.6)
    assert contexts(trace) == rows


def no_frames_from(t, bus):
    def change(simulator):
        inner = simulator.manager.step
        simulator.manager.step = lambda now, frames, view: inner(
            now, frames if now < t else [f for f in frames if bus is not None and f.bus != bus], view
        )

    return change


def no_model_from(t):
    def change(simulator):
        visiond = simulator.manager.visiond
        publish = visiond.publish
        visiond.publish = lambda model: publish(model) if model.t < t else None

    return change


@pytest.mark.parametrize(
    ("change", "alert", "within"),
    [
        (no_frames_from(7.0, None), "can_error", 0.15),
        (no_frames_from(7.0, 1), "radar_error", 0.6),
        (no_model_from(7.0), "model_error", 0.6),
    ],
    ids=["all CAN", "radar", "camera"],
)
def test_a_lost_input_raises_an_alert_and_releases_the_pedals(s1, change, alert, within):
    result = drive(replace(s1, steps=2500), change)
    first = result.record["alerts"][0]
    assert first["name"] == alert
    assert 0.0 < first["t"] - 7.0 <= within
    after = result.trace["t"] > first["t"] + 0.03
    assert not result.trace["gas"][after].any() and not result.trace["brake"][after].any()
    assert not result.trace["engaged"][after].any()
    assert result.record["hazards"]["H1"] is not None


def lanes_from(t, shift):
    def change(simulator):
        look = simulator._camera.look

        def shifted(truth):
            view = look(truth)
            if truth.t < t:
                return view
            y = shift(truth.t)
            return view._replace(left_lane_y=view.left_lane_y + y, right_lane_y=view.right_lane_y + y)

        simulator._camera.look = shifted

    return change


@pytest.mark.parametrize("offset", [0.5, -0.5])
def test_a_car_off_the_middle_returns_without_overshoot(s1, offset):
    trace = drive(replace(s1, lateral_offset=offset, steps=1200)).trace
    distance = trace["lateral_offset"] * np.sign(offset)
    assert distance[:130] == pytest.approx(0.5)
    assert np.abs(distance[530:]).max() < 0.03
    assert distance.min() > -0.02


@pytest.mark.parametrize("shift", [1.0, -1.0])
def test_lanes_seen_a_metre_off_make_the_car_leave_its_lane(s1, shift):
    result = drive(s1, lanes_from(5.0, lambda t: shift))
    trace = result.trace
    distance = trace["lateral_offset"] * np.sign(shift)
    assert np.abs(trace["steer_torque"]).max() > 1.0
    assert distance[600] < 0.5 < 0.8 < distance[800]
    assert distance[1200:] == pytest.approx(1.0, abs=0.03)
    assert distance.max() < 1.03
    assert 6.0 < result.record["hazards"]["H3"] < 10.0


def test_drifting_lanes_saturate_the_steering(s1):
    """The lanes drift by half a metre per step."""
    result = drive(replace(s1, steps=1000), lanes_from(5.0, lambda t: 50.0 * (t - 5.0)))
    assert [alert["name"] for alert in result.record["alerts"]] == ["steer_saturated"]
    assert 5.8 < result.record["alerts"][0]["t"] < 6.5
    assert 5.5 < result.record["hazards"]["H3"] < 7.5
    # half a radian a second from the motor and, when the wheel returns, as much from the tyres
    assert np.abs(np.diff(result.trace["steer_angle"])).max() < 1.1 / 100


@pytest.mark.parametrize("side", [1, -1])
def test_lanes_too_far_off_for_a_solution_give_full_torque_to_the_left(s1, side):
    """This begins when the lanes are some 400 m away."""
    trace = drive(replace(s1, steps=1500), lanes_from(5.0, lambda t: 50.0 * side * (t - 5.0))).trace
    unsolved = np.flatnonzero(np.isnan(trace["angle_desired"]))
    assert len(unsolved) > 50
    # a command acts in the next step; 3840 counts are the EPS' full torque
    assert set(trace["steer_torque"][unsolved[:-1] + 1]) == {4096 / 3840}


def test_the_car_holds_a_bend_of_500_m(s1):
    bend = replace(s1, lead=None, curvature=((0.0, 150.0, 250.0), (0.0, 0.0, 0.002)))
    trace = drive(bend).trace
    offset = trace["lateral_offset"]
    assert np.abs(offset).max() < 0.5
    assert np.ptp(offset[2500:]) < 0.02
    assert 0.4 < trace["steer_torque"][2500:].mean() < 0.6


def test_the_car_climbs_a_grade(s1):
    slope = replace(s1, lead=None, grade=((0.0, 10.0, 11.0), (0.0, 0.0, 1.0)))
    trace = drive(slope).trace
    assert trace["gas"][2500:].mean() > trace["gas"][700:900].mean() + 0.1
    assert trace["v_ego"][-1] == pytest.approx(97 / 3.6, abs=0.5)


def test_earlier_runs_do_not_change_a_run(scenarios, fault_free):
    simulator = Simulator()
    s1 = load_scenario(scenarios / "S1.yaml")
    broken = drive(replace(s1, steps=1500), lanes_from(5.0, lambda t: 50.0 * (t - 5.0)), simulator)
    assert np.isnan(broken.trace["angle_desired"]).any()
    drive(replace(load_scenario(scenarios / "S5.yaml"), steps=2200), simulator=simulator)
    again = drive(s1, simulator=simulator)
    assert again.record == fault_free("S1").record
    for name, values in again.trace.items():
        assert values.tobytes() == fault_free("S1").trace[name].tobytes(), name
