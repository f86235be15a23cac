"""The reference plant copies openpilot's simulator, including its errors."""

import json
from dataclasses import replace
from math import degrees

import numpy as np
import pytest
from selfdrive.car.honda.interface import CarInterface, get_params
from selfdrive.common.errors import ConfigError
from selfdrive.messages import Actuators
from selfdrive.sim.plant import Plant
from selfdrive.sim.reference_plant import CrudeLateral, ReferencePlant
from selfdrive.sim.run import main
from selfdrive.sim.scenario import load_scenario, parse_scenario, with_plant
from selfdrive.sim.sensors import CarSensors
from selfdrive.sim.simulator import Simulator
from selfdrive.sim.truth import GroundTruth

TEXT = "schema: scenario/1\nname: a\ntitle: b\nduration_s: 1\nhost: {speed_mps: 20}\nplant: reference\n"


@pytest.fixture
def car():
    return ReferencePlant(get_params(), speed=20.0)


@pytest.fixture
def s1(scenarios):
    return with_plant(load_scenario(scenarios / "S1.yaml"), "reference")


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("speed", [0.0, 30.0])
def test_torque_turns_the_wheel_slowly(sign, speed):
    lateral = CrudeLateral()
    assert [lateral.step(sign * 1.0, speed, 0.0) for _ in range(200)] == [speed] * 200
    assert degrees(lateral.steer_angle) == pytest.approx(0.2 * sign)
    assert lateral.offset == pytest.approx(sign * 0.2 / 5 / 0.1067)
    assert lateral.heading == 0.0


def test_only_every_fifth_step_moves_the_car():
    moved = []
    for pushed in range(10):
        lateral = CrudeLateral()
        for step in range(10):
            lateral.step(float(step == pushed), 20.0, 0.0)
        assert degrees(lateral.steer_angle) == pytest.approx(0.001)
        moved.append(lateral.offset != 0.0)
    assert [step for step in range(10) if moved[step]] == [0, 5]


def test_the_wheel_does_not_return_by_itself():
    lateral = CrudeLateral()
    for torque in [1.0] * 100 + [0.0] * 500:
        lateral.step(torque, 30.0, 0.0)
    assert degrees(lateral.steer_angle) == pytest.approx(0.1)
    assert lateral.offset == pytest.approx(0.02 / 0.1067)
    assert lateral.steer_rate == 0.0


def test_longitudinal_motion_equals_that_of_the_standard_plant(car):
    standard = Plant(get_params(), speed=20.0)
    for k in range(2000):
        pedals = Actuators(gas=0.3 * (k < 200), brake=0.8 * (k >= 200))
        car.step(pedals, 0.5, 0.0)
        standard.step(pedals, 0.5, 0.0)
        assert (car.position, car.speed, car.acceleration) == (
            standard.position,
            standard.speed,
            standard.acceleration,
        )
    assert car.speed == 0.0


def test_headway_time(car):
    """Headway time is distance over speed.

    While the car stands, the last value is used; before the car has moved, 30 s.
    """
    assert ReferencePlant(get_params(), speed=0.0).headway(50.0) == 30.0
    assert car.headway(50.0) == 2.5
    car.speed = 0.0
    assert car.headway(40.0) == 2.5
    assert np.isinf(Plant(get_params(), speed=0.0).headway(50.0))


def test_distance_ends_at_zero(car):
    car.position = 10.0
    assert (car.distance_to(12.0), car.distance_to(8.0)) == (2.0, 0.0)
    standard = Plant(get_params(), speed=20.0)
    standard.position = 10.0
    assert standard.distance_to(8.0) == -2.0


def test_the_lane_offset_is_hidden_from_the_sensors(s1):
    simulator = Simulator()
    simulator.reset(s1, 0)
    simulator._plant.lateral.offset = 0.5
    seen, step = [], simulator.manager.step

    def watched(t, frames, view):
        seen.append((view, [f.data for f in frames if f.address == 0x445]))
        return step(t, frames, view)

    simulator.manager.step = watched
    simulator.step()
    view, [track] = seen[0]
    assert (view.left_lane_y, view.right_lane_y, view.path_y, set(view.bend)) == (1.85, -1.85, 0.0, {0.0})
    assert int.from_bytes(track, "big") >> 40 & 0xFFF == 0
    assert simulator.result().trace["lateral_offset"][0] == 0.5


@pytest.mark.parametrize(
    ("speed", "read"), [(0.5, 1.8), (0.29, 0.0), (1.0, 3.6), (3.5, 8.05), (6.0, 6.0), (20.0, 20.0)]
)
def test_the_gearbox_speed_has_the_wrong_unit(truth, speed, read):
    """The gearbox reports km/h as m/s."""
    sensors, interface = CarSensors(ReferencePlant.gearbox_scale), CarInterface()
    state = interface.update(sensors.measure(truth(v_ego=speed), 0, 0), 0.0)
    assert state.v_ego_raw == pytest.approx(read, abs=0.01)


def test_a_scenario_can_select_the_plant(scenarios):
    assert parse_scenario(TEXT, "a.yaml", "").plant == "reference"
    plain = load_scenario(scenarios / "S1.yaml")
    assert plain.plant == "standard"
    assert with_plant(plain, "reference").plant == "reference"
    assert with_plant(parse_scenario(TEXT, "a.yaml", ""), "standard").plant == "standard"


@pytest.mark.parametrize(
    ("text", "line", "remedy"),
    [
        (TEXT.replace("reference", "referenz"), 6, "plant is standard"),
        (TEXT.replace("20}", "20, lateral_offset_m: 0.5}"), 6, "use the standard plant"),
        (TEXT + "road: {curvature: {at_m: [0], per_m: [0.001]}}\n", 6, "use the standard plant"),
    ],
)
def test_unsupported_scenarios_are_refused(text, line, remedy):
    with pytest.raises(ConfigError) as caught:
        parse_scenario(text, "a.yaml", "")
    assert str(caught.value).startswith(f"a.yaml:{line}: plant: ")
    assert remedy in str(caught.value)


def test_the_command_line_can_select_the_plant(scenarios, tmp_path, capsys):
    common = ["--max-steps", "5", "--plant", "reference", "--out", str(tmp_path / "out")]
    assert main(["--scenario", str(scenarios / "S1.yaml"), *common]) == 0
    assert json.loads((tmp_path / "out" / "record.json").read_text())["plant"] == "reference"
    bend = tmp_path / "bend.yaml"
    bend.write_text(TEXT.replace("plant: reference", "road: {curvature: {at_m: [0], per_m: [0.001]}}"))
    assert main(["--scenario", str(bend), *common]) == 2
    assert "a on the plant 'reference', expected a straight road" in capsys.readouterr().err


def test_one_simulator_can_run_both_plants(s1):
    simulator, results = Simulator(), []
    for scenario in (s1, replace(s1, plant="standard"), s1):
        simulator.reset(replace(scenario, steps=200), 0)
        while not simulator.is_finished:
            simulator.step()
        results.append(simulator.result())
    assert [result.record["plant"] for result in results] == ["reference", "standard", "reference"]
    for name, values in results[0].trace.items():
        assert values.tobytes() == results[2].trace[name].tobytes(), name


def test_the_lane_lines_are_mirrored(s1):
    simulator = Simulator()
    simulator.reset(s1, 0)
    simulator.step()
    model = simulator.manager.visiond.latest
    assert (model.left_lane.points[0], model.right_lane.points[0]) == (-1.85, 1.85)
    assert model.path.points[0] == 0.0


def test_frames_are_shifted_to_the_other_side(car):
    """In frames, a car left of the middle appears equally far to the right.

    Other sensors show it in the middle.
    """
    truth = GroundTruth(*(1.0, 50.0, 20.0, 20.0, 0.0, 0.3, 0.0, 0.0, 0.0, 20.0, 2.5), free_road=False)
    assert car.pictured(truth) == truth._replace(lateral_offset=-0.3)
    assert car.shown(truth) == truth._replace(lateral_offset=0.0)
