"""The closed loop agrees with measurements on openpilot v0.4.2 in the same traffic."""

import numpy as np
import pytest
from selfdrive.sim.run import simulate
from selfdrive.sim.scenario import PLANTS, load_scenario, with_plant

# First time with an HWT of 2 s, min HWT, min distance, max brake, max gas, speeds (m/s) at 5, 10, ... s.
# S5 omits values below 6 m/s, where openpilot's simulator sent the speed in the wrong unit.
MEASURED = {
    "S1": (6.94, 1.614, 29.22, 0.293, 0.088, (24.92, 20.27, 18.04, 17.43, 17.41, 17.56)),
    "S3": (6.94, 1.820, 37.95, 0.355, 0.092, (24.92, 20.68, 23.01, 24.30, 19.97, 19.01)),
    "S5": (6.94, 1.197, None, None, 0.088, (24.92, 19.51, 6.84)),
}


@pytest.mark.parametrize("name", MEASURED)
def test_longitudinal_control_agrees_with_openpilot(fault_free, name):
    close_at, headway, distance, brake, gas, speeds = MEASURED[name]
    trace = fault_free(name).trace
    assert trace["t"][np.argmax(trace["hwt"] <= 2.0)] == pytest.approx(close_at, abs=0.011)
    assert trace["hwt"].min() == pytest.approx(headway, abs=0.005)
    assert trace["gas"].max() == pytest.approx(gas, abs=0.002)
    rows = [min(500 * k, 2999) for k in range(1, len(speeds) + 1)]
    assert trace["v_ego"][rows] == pytest.approx(speeds, abs=0.02)
    if distance is not None:
        assert trace["d_rel"].min() == pytest.approx(distance, abs=0.05)
        assert trace["brake"].max() == pytest.approx(brake, abs=0.005)


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize("name", ["O17", "O18", "O19", "O20"])
def test_the_driver_is_warned_two_seconds_before_contact(scenarios, name, plant):
    """openpilot warns at the same time."""
    result = simulate(with_plant(load_scenario(scenarios / f"{name}.yaml"), plant), 0)
    contact = result.record["hazards"]["H1"]
    warned = [alert["t"] for alert in result.record["alerts"] if alert["name"] == "fcw"]
    assert contact - warned[0] == pytest.approx(2.0, abs=0.1)
    assert result.record["engaged_from"] is None
