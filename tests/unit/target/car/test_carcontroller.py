"""The commands that the car controller sends to the Civic's actuators."""

import cantools
import pytest
from selfdrive.car.honda.carcontroller import BrakeHysteresis, CarController
from selfdrive.car.honda.values import CAR_DBC, COMMAND_MESSAGES
from selfdrive.messages import Actuators, CarControl, CarState
from selfdrive.sim.actuators import ActuatorReceiver

DBC = cantools.database.load_file(CAR_DBC)


class Rig:
    def __init__(self):
        self.controller = CarController()
        self.receiver = ActuatorReceiver()
        self.frame = 0
        self.car = CarState()

    def send(self, cycles=2, enabled=True, **demand):
        for _ in range(cycles):
            control = CarControl(enabled=enabled, actuators=Actuators(**demand))
            frames = self.controller.update(control, self.car, self.frame)
            taken = self.receiver.update(frames, self.frame / 100)
            self.frame += 1
        return taken


@pytest.fixture
def rig():
    return Rig()


def test_gas_is_quantised_as_in_openpilot(rig):
    """Gas is sent in whole pedal counts, with the values that openpilot's plant decoded."""
    assert rig.send(gas=0.011).gas == pytest.approx(0.01094, abs=1e-5)  # 11 counts
    assert rig.send(gas=0.0359).gas == pytest.approx(0.035743, abs=1e-6)  # 36 counts
    assert rig.send(gas=0.0119).gas == pytest.approx(0.01094, abs=1e-5)  # 11.95 counts, truncated
    assert rig.send(gas=1.5).gas == pytest.approx(0.99611, abs=1e-4)
    assert rig.send(gas=0.0).gas == 0.0
    assert rig.send(gas=-0.5).gas == 0.0


def test_brake_rises_slowly_and_falls_at_once(rig):
    assert rig.send(cycles=50, brake=0.8).brake == pytest.approx(0.49, abs=0.011)
    assert rig.send(cycles=50, brake=0.8).brake == pytest.approx(0.79, abs=0.004)
    assert rig.send(cycles=2, brake=0.0).brake == 0.0


def test_brake_is_quantised_and_limited_to_255_counts(rig):
    assert rig.send(cycles=200, brake=5.0).brake == 255 / 256
    rig.send(brake=0.0)
    assert rig.send(cycles=60, brake=0.3).brake == 74 / 256  # 0.29 is 74.24 counts
    assert rig.send(cycles=60, brake=0.312).brake == 77 / 256  # 0.302 is 77.3 counts
    assert rig.send(cycles=60, brake=0.3255).brake == 80 / 256  # 0.3155 is 80.8 counts, truncated


def test_brake_hysteresis():
    hysteresis = BrakeHysteresis()
    assert hysteresis.update(0.019) == 0.0
    assert hysteresis.update(0.021) == pytest.approx(0.011)
    assert hysteresis.update(0.006) == pytest.approx(0.011)
    assert hysteresis.update(0.004) == 0.0
    assert hysteresis.update(0.006) == 0.0
    assert hysteresis.update(0.5) == pytest.approx(0.49)
    assert hysteresis.update(0.4951) == pytest.approx(0.49)
    assert hysteresis.update(0.479) == pytest.approx(0.489)


@pytest.mark.parametrize(
    ("steer", "taken"), [(1.0, 4096), (-1.0, -4096), (2.5, 4096), (0.1, 409), (-0.1, -409)]
)
def test_torque_is_limited_and_truncated_to_counts(rig, steer, taken):
    assert rig.send(steer=steer).steer == pytest.approx(taken / 3840)


def test_no_torque_is_sent_while_steering_is_not_allowed(rig):
    rig.car = CarState(steer_not_allowed=True)
    assert rig.send(steer=0.5).steer == 0.0


def test_disabled_control_sends_zero_commands(rig):
    rig.send(cycles=30, gas=0.3, brake=0.3, steer=0.3)
    taken = rig.send(enabled=False, gas=0.3, brake=0.3, steer=0.3)
    assert (taken.gas, taken.brake, taken.steer) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("bad", [float("nan"), float("inf"), float("-inf")])
def test_nan_and_infinite_demands_are_sent_as_zero(rig, bad):
    taken = rig.send(gas=bad, brake=bad, steer=bad)
    assert (taken.gas, taken.brake, taken.steer) == (0.0, 0.0, 0.0)
    assert rig.send(cycles=20, brake=0.1).brake > 0.0


def test_each_command_has_its_period(rig):
    addresses = []
    for frame in range(20):
        frames = rig.controller.update(CarControl(enabled=True), rig.car, frame)
        addresses.append({f.address for f in frames})
    assert all(0xE4 in sent for sent in addresses)
    assert [k for k, sent in enumerate(addresses) if {0x200, 0x1FA} <= sent] == list(range(0, 20, 2))
    assert [k for k, sent in enumerate(addresses) if {0x30C, 0x33D} <= sent] == [0, 10]


@pytest.mark.parametrize(
    ("control", "shown"),
    [
        (
            {"enabled": True, "speed_visible": True, "set_speed": 97 / 3.6, "lanes_visible": True},
            {"CRUISE_SPEED": 97, "HUD_LEAD": 1, "SOLID_LANES": 1, "CRUISE_OVERRIDE": 1, "FCW": 0, "CHIME": 0},
        ),
        ({"enabled": True, "lead_visible": True}, {"CRUISE_SPEED": 255, "HUD_LEAD": 2, "SOLID_LANES": 0}),
        ({"cancel_cruise": True, "lead_visible": True}, {"CRUISE_CANCEL_CMD": 1, "HUD_LEAD": 0}),
        (
            {"visual_alert": "fcw", "audible_alert": "chime_repeated"},
            {"FCW": 2, "CHIME": 1, "BEEP": 1, "STEERING_REQUIRED": 0, "CRUISE_CANCEL_CMD": 0},
        ),
        ({"visual_alert": "steer_required"}, {"FCW": 0, "BEEP": 0, "STEERING_REQUIRED": 1}),
    ],
)
def test_the_dashboard_shows_speed_lead_lanes_and_warnings(rig, control, shown):
    values = {}
    for frame in rig.controller.update(CarControl(**control), rig.car, 0):
        values |= DBC.decode_message(frame.address, frame.data, decode_choices=False)
    assert {name: values[name] for name in shown} == shown


def test_the_receiver_accepts_every_command_frame(rig):
    parser = rig.receiver._parser
    for cycle in range(40):
        rig.send(cycles=1, steer=0.01 * cycle, gas=0.01 * cycle)
        expected = set(COMMAND_MESSAGES) if cycle % 2 == 0 else {"STEERING_CONTROL"}
        assert set(parser.updated) == expected
