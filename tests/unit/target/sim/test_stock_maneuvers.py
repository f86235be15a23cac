"""The 20 stock maneuvers of openpilot v0.4.2 as scenarios."""

import pytest
from selfdrive.common.conversions import MPH_TO_MS
from selfdrive.sim.scenario import load_scenario

MPH_20, MPH_40, MPH_60 = 20 * MPH_TO_MS, 40 * MPH_TO_MS, 60 * MPH_TO_MS
SET, RESUME = 3, 4
SET_EARLY = ((SET, 120, 130),)


def resumed(times):
    """Return a press of SET at 1.2 s, followed by presses of RES every 0.2 s, each 0.1 s long."""
    return (*SET_EARLY, *((RESUME, 140 + 20 * k, 150 + 20 * k) for k in range(times)))


STOP_AND_GO = ((10, 0, 0, 10, 0, 10), (10, 20, 30, 40, 50, 60))
# speed (m/s), gap (m), lead's speeds (m/s) and times (s), buttons (code, down and up in steps), duration (s)
MANEUVERS = {
    "O01": (MPH_40, None, None, ((SET, 200, 230), (RESUME, 1000, 1010), (RESUME, 1020, 1030)), 30),
    "O02": (MPH_60, None, None, ((SET, 200, 230), (SET, 1000, 1010), (SET, 1020, 1030)), 30),
    "O03": (MPH_20, None, None, SET_EARLY, 25),
    "O04": (MPH_20, None, None, SET_EARLY, 25),
    "O05": (MPH_60, 100, ((MPH_40,), (0,)), SET_EARLY, 30),
    "O06": (MPH_40, 150, ((0,), (0,)), SET_EARLY, 30),
    "O07": (20, 35, ((20, 20, 0), (0, 15, 35)), SET_EARLY, 50),
    "O08": (20, 35, ((20, 20, 0), (0, 15, 25)), SET_EARLY, 50),
    "O09": (0, 100, ((0,), (0,)), resumed(3), 30),
    "O10": (30, 49, ((30, 30, 29, 31, 29, 31, 29), (0, 6, 8, 12, 16, 20, 24)), resumed(2), 25),
    "O11": (10, 20, STOP_AND_GO, resumed(2), 70),
    "O12": (0, 4, ((0, 0, 45), (0, 10, 40)), resumed(5), 30),
    "O13": (0, 20, ((10, 0, 0, 10, 0, 0), (10, 20, 30, 40, 50, 60)), resumed(2), 70),
    "O14": (0, 20, ((10, 0, 0, 10, 0, 0), (10, 13, 26, 33, 36, 45)), resumed(2), 45),
    "O15": (10, 10, ((20, 10), (1, 11)), resumed(5), 30),
    "O16": (10, 10, ((20, 0), (1, 11)), resumed(5), 30),
    "O17": (30, 100, ((20,), (0,)), (), 15),
    "O18": (20, 35, ((20, 0), (3, 23)), (), 18),
    "O19": (20, 35, ((20, 0), (3, 9.6)), (), 13),
    "O20": (20, 35, ((20, 0), (3, 7)), (), 8),
}
GRADES = {"O03": ((0, 10, 11), (0, 0, 1.0)), "O04": ((0, 10, 11), (0, 0, -1.0))}


@pytest.mark.parametrize("name", MANEUVERS)
def test_the_scenario_equals_the_stock_maneuver(scenarios, name):
    speed, gap, profile, buttons, duration = MANEUVERS[name]
    scenario = load_scenario(scenarios / f"{name}.yaml")
    assert (scenario.name, scenario.steps, scenario.plant) == (name, 100 * duration, "standard")
    assert scenario.speed == pytest.approx(speed)
    assert scenario.grade == GRADES.get(name)
    assert (scenario.curvature, scenario.lateral_offset) == (None, 0.0)
    assert (
        tuple((press.button_code, press.press_step, press.release_step) for press in scenario.buttons)
        == buttons
    )
    if gap is None:
        assert scenario.lead is None
    else:
        assert scenario.lead.gap == gap
        assert scenario.lead.speeds == pytest.approx(profile[0])
        assert scenario.lead.times == profile[1]


def test_all_twenty_maneuvers_exist(scenarios):
    assert sorted(path.stem for path in scenarios.glob("O*.yaml")) == sorted(MANEUVERS)
