"""The controlled car's lateral response at 60 mph: overshoot, settling and steady error."""

from dataclasses import replace

import numpy as np
import pytest
from selfdrive.sim.scenario import load_scenario
from selfdrive.sim.simulator import Simulator

FULL_TORQUE = 4096 / 3840  # the largest command, as a multiple of the EPS' full torque
STEP_AT, STEP = 800, 0.5  # simulation step, m


@pytest.fixture
def drive(scenarios):
    """Run a lateral scenario, mirrored on request. `step` moves the lane (m, to the left) after 8 s."""

    def run(name, side=1, step=0.0):
        scenario = load_scenario(scenarios / f"{name}.yaml")
        bend = scenario.curvature
        scenario = replace(
            scenario,
            lateral_offset=0.0 if step else side * scenario.lateral_offset,
            curvature=bend and (bend[0], tuple(side * c for c in bend[1])),
        )
        simulator = Simulator()
        simulator.reset(scenario, 0)
        while not simulator.is_finished:
            if simulator.frame == STEP_AT:
                simulator._plant.lateral.offset -= step
            simulator.step()
        return simulator.result()

    return run


def settling(trace, start, band):
    outside = np.flatnonzero(np.abs(trace["lateral_offset"]) > band)
    return trace["t"][outside[-1]] - start


@pytest.mark.parametrize("side", [1, -1])
def test_response_to_an_initial_offset(drive, side):
    result = drive("L01", side)
    offset = side * result.trace["lateral_offset"]
    assert offset[:131] == pytest.approx(0.5)
    assert 3.0 < settling(result.trace, 1.31, 0.025) < 3.6
    assert offset.min() > -0.005
    assert np.abs(offset[-200:]).max() < 0.005
    assert result.record["alerts"] == [] and set(result.record["hazards"].values()) == {None}


@pytest.mark.parametrize("side", [1, -1])
def test_response_to_a_step_of_the_lane(drive, side):
    result = drive("L01", step=side * STEP)
    trace = result.trace
    left_to_go = -side * trace["lateral_offset"][STEP_AT:] / STEP
    assert np.abs(trace["lateral_offset"][:STEP_AT]).max() < 1e-6
    assert left_to_go[0] == pytest.approx(1.0, abs=0.001)
    assert 1.4 < np.flatnonzero(left_to_go < 0.5)[0] / 100 < 1.7
    assert 3.1 < settling(trace, 8.0, 0.05 * STEP) < 3.7
    assert left_to_go.min() > -0.01
    assert np.abs(left_to_go[-100:]).max() < 0.005
    assert 0.6 < np.abs(trace["steer_torque"]).max() < FULL_TORQUE
    assert result.record["alerts"] == []


@pytest.mark.parametrize("side", [1, -1])
def test_response_to_a_bend_of_500_m(drive, side):
    result = drive("L02", side)
    trace = result.trace
    outside = -side * trace["lateral_offset"]
    assert outside[-500:] == pytest.approx(0.29, abs=0.03)
    assert np.ptp(outside[-500:]) < 0.005
    assert outside.min() > -0.01 and outside.max() < outside[-1] + 0.03
    assert side * trace["steer_torque"][-500:].mean() == pytest.approx(0.52, abs=0.03)
    # the bicycle model's steady turn: 13 * 2.70 m * (1 + 0.0014 s^2/m^2 * v^2) / 500 m
    steady = 13.0 * 2.70 * (1.0 + 0.0014 * trace["v_ego"][-1] ** 2) / 500.0
    assert side * trace["steer_angle"][-500:].mean() == pytest.approx(steady, rel=0.01)
    assert result.record["alerts"] == [] and set(result.record["hazards"].values()) == {None}


@pytest.mark.parametrize("side", [1, -1])
def test_response_to_saturated_torque(drive, side):
    result = drive("L03", side)
    trace = result.trace
    outside = -side * trace["lateral_offset"]
    full = np.flatnonzero(side * trace["steer_torque"] > 1.0)
    assert len(full) == pytest.approx(207, abs=15)
    (alert,) = result.record["alerts"]
    assert alert["name"] == "steer_saturated"
    assert 0.8 < alert["t"] - trace["t"][full[0]] < 1.3
    assert outside.max() == pytest.approx(0.946, abs=0.003)  # 4 mm less than a departure
    assert result.record["hazards"]["H3"] is None
    after = trace["t"] > trace["t"][outside.argmax()]
    assert outside[after].min() > -0.02  # the integrator has not wound up
    assert settling(trace, trace["t"][full[-1]], 0.05) < 5.0
