"""The closed loop against what was measured on openpilot v0.4.2 in the same traffic."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from selfdrive.sim.scenario import load_scenario, parse_scenario
from selfdrive.sim.simulator import SimulationResult, Simulator

SCENARIOS = Path(__file__).parents[4] / "fault_library" / "scenarios"

# min time headway, min distance, max brake, max gas, speeds (m/s) at 5, 10, ... s; while above 6 m/s
MEASURED = {
    "S1": (1.614, 29.22, 0.293, 0.088, (24.92, 20.27, 18.04, 17.43, 17.41, 17.56)),
    "S3": (1.820, 37.95, 0.355, 0.092, (24.92, 20.68, 23.01, 24.30, 19.97, 19.01)),
    "S5": (1.197, None, None, 0.088, (24.92, 19.51, 6.84)),
}

CRASH = """
schema: scenario/1
name: crash
title: nobody brakes
duration_s: {duration}
host: {{speed_mps: {speed}}}
lead: {{gap_m: {gap}, speed_mps: {speeds}, at_s: {times}}}
"""


def run(scenario) -> SimulationResult:
    simulator = Simulator()
    simulator.reset(scenario)
    while not simulator.done:
        simulator.step()
    return simulator.result()


@cache
def library(name: str) -> SimulationResult:
    """A fault-free run of a scenario of the library."""
    return run(load_scenario(SCENARIOS / f"{name}.yaml"))


@pytest.mark.parametrize("name", MEASURED)
def test_longitudinal_control_is_the_original(name: str) -> None:
    """Headway, distance, pedals and speeds lie where the original's do."""
    headway, distance, brake, gas, speeds = MEASURED[name]
    trace = library(name).trace
    assert trace["hwt"][20:].min() == pytest.approx(headway, abs=0.005)
    assert trace["gas"].max() == pytest.approx(gas, abs=0.002)
    assert [trace["v_ego"][min(500 * k, 2999)] for k in range(1, len(speeds) + 1)] == pytest.approx(
        speeds, abs=0.02
    )
    if distance is not None:
        assert trace["d_rel"].min() == pytest.approx(distance, abs=0.05)
        assert trace["brake"].max() == pytest.approx(brake, abs=0.005)


@pytest.mark.parametrize(("name", "contexts"), [("S1", 3), ("S2", 4), ("S3", 4), ("S4", 4), ("S5", 3)])
def test_fault_free_runs_reach_the_contexts_without_hazard(name: str, contexts: int) -> None:
    """Engaged from 1.3 s to the end, no hazard, no counted alert, and all contexts of the experiments."""
    result = library(name)
    record, trace = result.record, result.trace
    assert record["engaged_from"] == pytest.approx(1.3, abs=0.02)
    assert record["engaged_to"] == pytest.approx(29.99)
    assert set(record["hazards"].values()) == {None} and record["alerts"] == []
    assert np.allclose(trace["v_cruise"][200:] * 3.6, 97.0)
    engaged = trace["engaged"] == 1
    reached = {
        (h <= 2.0, v >= 0.0) for h, v in zip(trace["hwt"][engaged], trace["v_rel"][engaged], strict=True)
    }
    assert len(reached) == contexts


@pytest.mark.parametrize(
    ("speed", "gap", "speeds", "times", "duration"),
    [
        (30, 100, [20], [0], 13),
        (20, 35, [20, 0], [3, 23], 14),
        (20, 35, [20, 0], [3, 9.6], 10),
        (20, 35, [20, 0], [3, 7], 8),
    ],
)
def test_warning_two_seconds_before_contact(
    speed: float, gap: float, speeds: list, times: list, duration: float
) -> None:
    """A driver who is about to run into the lead is warned about two seconds before, as by the original."""
    text = CRASH.format(speed=speed, gap=gap, speeds=speeds, times=times, duration=duration)
    result = run(parse_scenario(text, "crash", ""))
    contact = result.trace["t"][result.trace["d_rel"] <= 0.0][0]
    warned = [alert["t"] for alert in result.record["alerts"] if alert["name"] == "fcw"]
    assert contact - warned[0] == pytest.approx(2.0, abs=0.1)
    assert result.record["engaged_from"] is None
