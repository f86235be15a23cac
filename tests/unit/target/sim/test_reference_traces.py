"""On the reference plant, the closed loop agrees with openpilot v0.4.2 in its own simulator.

The recordings of openpilot are not part of the project. OPENPILOT_TRACES names their folder.
"""

import csv
import os
from dataclasses import replace
from functools import cache
from math import radians
from pathlib import Path

import numpy as np
import pytest
from selfdrive.common.conversions import MPH_TO_MS
from selfdrive.sim.run import simulate
from selfdrive.sim.scenario import load_scenario, with_plant
from selfdrive.sim.simulator import Simulator

REPO = Path(__file__).parents[4]
TRACES = Path(os.environ.get("OPENPILOT_TRACES", REPO.parent / "shared/reference/openpilot_v0.4.2/traces"))
SCENARIOS = REPO / "fault_library" / "scenarios"
RECORDED = ("S1", "S3", "S5", "S1_nolead", *(f"O{k:02}" for k in range(1, 11)))
LOG_DELAY = 1  # steps by which the recordings delay the controller's messages

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def read_recording():
    """Read a recording: its steps, and its columns as arrays with NaN where nothing was published."""

    def read(name):
        path = TRACES / f"{name}.csv"
        if not path.exists():
            pytest.skip(f"no recorded run {path}; set OPENPILOT_TRACES to the folder that holds it")
        with path.open() as file:
            rows = list(csv.DictReader(file))

        def column(key):
            return np.array([float(row[key] or "nan") for row in rows])

        return np.round(100 * column("time")).astype(int), column

    return read


@pytest.fixture(scope="module")
def run_once():
    """Run a scenario on the reference plant once. `X_nolead` is X without its lead."""

    def run(name):
        scenario = with_plant(load_scenario(SCENARIOS / f"{name.removesuffix('_nolead')}.yaml"), "reference")
        return simulate(replace(scenario, lead=None) if name.endswith("_nolead") else scenario, 0)

    return cache(run)


def rms(values):
    return np.sqrt(np.nanmean(np.square(values)))


@pytest.mark.parametrize("name", RECORDED)
def test_a_run_agrees_with_its_recording(read_recording, run_once, name):
    steps, column = read_recording(name)
    result = run_once(name)
    trace = {channel: values[steps] for channel, values in result.trace.items()}
    assert rms(trace["v_ego"] - column("speed")) < 0.03
    assert rms(trace["d_rel"] - column("d_rel")) < 0.03
    assert np.abs(trace["d_rel"] - column("d_rel")).max() < 0.1
    assert trace["d_rel"].min() == pytest.approx(column("d_rel").min(), abs=0.05)
    assert trace["hwt"].min() == pytest.approx(column("headway_time").min(), abs=0.01)
    assert trace["brake"].max() == pytest.approx(column("brake").max(), abs=0.02)
    published = np.maximum(steps - LOG_DELAY, 0)
    enabled = column("enabled") == 1.0
    assert result.trace["engaged"][published].astype(bool).tolist() == enabled.tolist()
    set_speed = result.trace["v_cruise"][published] * 3.6
    assert set_speed[enabled] == pytest.approx(column("vCruise")[enabled])
    assert result.record["hazards"] == {"H1": None, "H2": None, "H3": None, "H4": None}
    assert result.record["alert_events"] == []


@pytest.mark.parametrize("name", ["S1", "S3", "O02", "O09"])
def test_the_controllers_estimates_agree_with_the_recording(read_recording, run_once, name):
    steps, column = read_recording(name)
    trace = run_once(name).trace
    later = steps > 150
    published = steps[later] - LOG_DELAY
    assert trace["v_ego_est"][published] == pytest.approx(column("vEgo")[later], abs=0.02)
    assert trace["v_pid"][published] == pytest.approx(column("vPid")[later], abs=0.02)
    planned = steps[later]
    assert trace["v_target"][planned] == pytest.approx(column("plan_vTarget")[later], abs=0.02)
    assert trace["a_target"][planned] == pytest.approx(column("plan_aTarget")[later], abs=0.02)
    assert trace["lead_v_lead_k"][planned] == pytest.approx(column("lead_vLeadK")[later], abs=0.05)
    assert trace["lead_a_lead_k"][planned] == pytest.approx(column("lead_aLeadK")[later], abs=0.05)


@pytest.mark.parametrize("name", ["S5", "O06", "O08"])
def test_the_final_brake_equals_the_recorded_one(read_recording, run_once, name):
    _, column = read_recording(name)
    assert run_once(name).trace["brake"][-1] == pytest.approx(column("brake")[-1], abs=1e-5)


@pytest.mark.parametrize(("name", "rows"), [("S1", 3), ("S2", 4), ("S3", 4), ("S4", 4), ("S5", 3)])
def test_runs_reach_as_many_contexts_as_openpilot(run_once, name, rows):
    """S1 misses the fourth row that openpilot reaches."""
    result = run_once(name)
    trace = result.trace
    armed = trace["t"] >= 1.5
    far, closing = trace["hwt"][armed] > 2.0, trace["v_rel"][armed] < 0.0
    assert len(set(zip(far.tolist(), closing.tolist(), strict=True))) == rows
    assert result.record["alert_events"] == []
    if name == "S1":
        assert trace["hwt"][-1] == pytest.approx(1.985, abs=0.002)


def faulty(scenario, disturb):
    """Run a scenario with `disturb(simulator, truths)`. `truths` are the ground truths so far."""
    simulator, truths = Simulator(), []
    simulator.reset(scenario, 0)
    observe = simulator._observe
    simulator._observe = lambda t: truths.append(observe(t)) or truths[-1]
    disturb(simulator, truths)
    while not simulator.is_finished:
        simulator.step()
    return simulator.result().record


@pytest.fixture
def on_reference_plant(scenarios):
    return lambda name: with_plant(load_scenario(scenarios / f"{name}.yaml"), "reference")


@pytest.fixture
def s1(scenarios):
    return with_plant(load_scenario(scenarios / "S1.yaml"), "reference")


def angle_off(degrees):
    """Return a disturbance: an error of the measured steering angle while the headway time is 0 to 2 s."""

    def disturb(simulator, truths):
        measure = simulator._sensors.measure

        def disturbed(truth, button, frame):
            off = radians(degrees) if 0.0 <= truth.hwt <= 2.0 else 0.0
            return measure(truth._replace(steer_angle=truth.steer_angle + off), button, frame)

        simulator._sensors.measure = disturbed

    return disturb


# The error of 0.86 deg and the times are published for openpilot. The other errors were chosen to give these
# times and, at 13.0 s, the published torque of 0.952.
@pytest.mark.parametrize(
    ("degrees", "leaves"), [(0.86, 11.9), (-0.86, 11.9), (0.576, 13.0), (0.366, 18.3), (0.34, None)]
)
def test_the_offset_of_the_steering_angle_decides_when_the_car_leaves_its_lane(s1, degrees, leaves):
    record = faulty(s1, angle_off(degrees))
    assert record["alerts"] == []
    if leaves is None:
        assert record["hazards"]["H3"] is None
    else:
        assert record["hazards"]["H3"] == pytest.approx(leaves, abs=0.1)


def near(truths):
    return any(truth.hwt <= 2.0 for truth in truths)


def lose_frames(simulator, truths):
    step = simulator.manager.step
    simulator.manager.step = lambda t, frames, view: step(t, [] if near(truths) else frames, view)


def lose_model(simulator, truths):
    visiond = simulator.manager.visiond
    publish = visiond.publish
    visiond.publish = lambda model: None if near(truths) else publish(model)


@pytest.mark.parametrize(
    ("disturb", "alert", "at", "hit"),
    [(lose_frames, "can_error", 7.085, 18.28), (lose_model, "model_error", 7.415, 19.30)],
)
def test_alert_and_contact_after_a_lost_input_occur_at_openpilots_times(s1, disturb, alert, at, hit):
    record = faulty(s1, disturb)
    assert [event["name"] for event in record["alerts"]] == [alert]
    assert record["alerts"][0]["t"] == pytest.approx(at, abs=0.011)
    assert record["hazards"]["H1"] == pytest.approx(hit, abs=0.02)


def is_far_behind_a_slower_lead(truth):
    return truth.hwt > 2.0 and truth.v_ego > truth.v_lead


def is_far_behind_a_faster_lead(truth):
    return truth.hwt > 2.0 and truth.v_ego <= truth.v_lead


def radar_too_fast(mph, active):
    """Return a disturbance: an error of the radar's relative speed far behind a slower lead.

    `active` collects the times at which the radar measured with the error.
    """

    def disturb(simulator, truths):
        measure = simulator._radar.measure

        def disturbed(shown):
            if is_far_behind_a_slower_lead(truths[-1]):
                active.append(shown.t)
                shown = shown._replace(v_lead=shown.v_lead + mph * MPH_TO_MS)
            return measure(shown)

        simulator._radar.measure = disturbed

    return disturb


# Before the warning and the reset looked at the original's nodes of the plan, the runs of S2 had a warning
# and 93, 227 and 211 active cycles, that of S5 no contact, a warning at 14.85 s and 227.
@pytest.mark.parametrize(
    ("name", "mph", "warned", "hit", "cycles"),
    [
        ("S2", 41, None, None, 95),
        ("S2", 55, None, None, 212),
        ("S2", 60, None, None, 205),
        ("S5", 41, 14.655, 25.29, 238),
    ],
)
def test_a_wrong_relative_speed_far_behind_ends_as_in_openpilot(
    on_reference_plant, name, mph, warned, hit, cycles
):
    """Warning, contact and the number of active radar cycles are the original's."""
    active = []
    record = faulty(on_reference_plant(name), radar_too_fast(mph, active))
    assert [event["t"] for event in record["alerts"]] == (
        [pytest.approx(warned, abs=0.011)] if warned else []
    )
    assert len(active) == pytest.approx(cycles, abs=1)
    if hit is not None:
        assert record["hazards"]["H1"] == pytest.approx(hit, abs=0.05)


def lanes_drift(left, right, when):
    """Return a disturbance: both lines move by these metres in each step in which `when` holds."""

    def disturb(simulator, truths):
        detector = simulator.manager.visiond._detector
        detect = detector.detect

        def disturbed(view):
            lines, steps = detect(view), sum(map(when, truths[:-1]))
            moved = {"left": left, "right": right}
            return lines._replace(
                **{k: (line := getattr(lines, k))._replace(y=line.y + by * steps) for k, by in moved.items()}
            )

        detector.detect = disturbed

    return disturb


@pytest.mark.parametrize("name", ["S1", "S2", "S3", "S4", "S5"])
def test_torque_saturates_as_in_openpilot_when_both_lines_run_away(on_reference_plant, name):
    """Before the lateral problem was solved at any condition, there was no alert."""
    record = faulty(on_reference_plant(name), lanes_drift(-1.542, 2.097, is_far_behind_a_slower_lead))
    assert [event["name"] for event in record["alerts"]] == ["steer_saturated"]
    assert record["alerts"][0]["t"] == pytest.approx(2.095, abs=0.011)
    assert record["hazards"]["H3"] is not None


def test_a_left_line_that_runs_away_late_ends_as_in_openpilot(on_reference_plant):
    """The car leaves its lane, and hits the lead it no longer recognises."""
    record = faulty(on_reference_plant("S3"), lanes_drift(-1.067, 0.0, is_far_behind_a_faster_lead))
    assert record["hazards"]["H3"] is not None
    assert record["hazards"]["H1"] == pytest.approx(28.46, abs=0.02)
