"""Decoding the Civic's frames."""

from math import radians

import pytest
from selfdrive.can.dbc import load_dbc
from selfdrive.can.packer import MessagePacker
from selfdrive.car.honda.carstate import CarStateReader
from selfdrive.car.honda.values import CAR_DBC, CruiseButton
from selfdrive.messages import ButtonEvent


@pytest.fixture
def reader():
    return CarStateReader()


def read(reader, bench, **kw):
    frames = bench.frames(**kw)
    return reader.update(frames, bench.t)


def pack(name, counter, **signals):
    return MessagePacker(load_dbc(CAR_DBC)[name], tuple(signals)).pack(tuple(signals.values()), counter)


def test_an_ordinary_car_is_ready_to_engage(reader, bench):
    state = read(reader, bench, v_ego=20.0, steer_angle=radians(12.3), steer_rate=radians(-7.0))
    assert state.can_valid and state.cruise_available and state.gear == "drive"
    assert state.v_ego_raw == pytest.approx(20.0, abs=0.002)
    assert state.steering_angle == pytest.approx(radians(12.3))
    assert state.steering_rate == pytest.approx(radians(-7.0))
    troubles = (
        *(
            "standstill",
            "gas_pressed",
            "brake_pressed",
            "steering_pressed",
            "door_open",
            "seatbelt_unlatched",
        ),
        *("esp_disabled", "steer_error", "steer_not_allowed", "brake_error", "brake_hold", "park_brake"),
    )
    assert not any(getattr(state, name) for name in troubles)
    assert state.buttons == ()


def test_the_car_is_not_ready_to_engage_before_the_first_frame(reader):
    state = reader.update([], 0.0)
    assert not state.can_valid
    assert state.door_open and state.seatbelt_unlatched and state.esp_disabled and state.steer_error
    assert state.gear == "unknown" and not state.cruise_available


def test_speed_estimate_starts_at_zero_and_overshoots(reader, bench):
    """openpilot gets its first reading at 0.12 s and estimates 27.108 m/s at 1.15 s for a coasting car."""
    estimates = [read(reader, bench, v_ego=26.8224 - 0.00176 * (k + 12)).v_ego for k in range(600)]
    assert estimates[2] == pytest.approx(8.9335, abs=0.01)
    assert max(estimates) > 29.5
    assert estimates[102] == pytest.approx(27.108, abs=0.02)
    assert estimates[-1] == pytest.approx(26.8224 - 0.00176 * 611, abs=0.03)


@pytest.mark.parametrize(
    ("wheels", "gearbox", "expected"), [(0.5, 1.0, 1.0), (3.5, 4.5, 4.0), (8.0, 9.0, 8.0)]
)
def test_wheel_and_gearbox_speed_are_blended(reader, wheels, gearbox, expected):
    kph = wheels * 3.6
    frames = [
        pack("WHEEL_SPEEDS", 0, **{f"WHEEL_SPEED_{w}": kph for w in ("FL", "FR", "RL", "RR")}),
        pack("ENGINE_DATA", 0, XMISSION_SPEED=gearbox * 3.6),
    ]
    assert reader.update(frames, 0.0).v_ego_raw == pytest.approx(expected, abs=0.005)


def test_only_a_stopped_car_is_at_standstill(reader, bench):
    assert read(reader, bench, v_ego=0.0).standstill
    creeping = read(reader, bench, v_ego=0.29)
    assert not creeping.standstill and creeping.v_ego_raw == 0.0
    rolling = read(reader, bench, v_ego=0.31)
    assert not rolling.standstill and rolling.v_ego_raw == pytest.approx(0.31, abs=0.002)


def test_buttons_raise_events_when_pressed_and_released(reader, bench):
    read(reader, bench)
    assert read(reader, bench, button=CruiseButton.DECEL_SET).buttons == (ButtonEvent("decel", True),)
    assert read(reader, bench, button=CruiseButton.DECEL_SET).buttons == ()
    change = read(reader, bench, button=CruiseButton.RES_ACCEL).buttons
    assert change == (ButtonEvent("decel", False), ButtonEvent("accel", True))
    assert read(reader, bench).buttons == (ButtonEvent("accel", False),)
    assert read(reader, bench, button=CruiseButton.CANCEL).buttons == (ButtonEvent("cancel", True),)


def test_the_setting_button_raises_an_event(reader):
    state = reader.update([pack("SCM_BUTTONS", 0, CRUISE_SETTING=1)], 0.0)
    assert state.buttons == (ButtonEvent("setting", True),)


@pytest.mark.parametrize(
    ("name", "signals", "field"),
    [
        ("POWERTRAIN_DATA", {"PEDAL_GAS": 3}, "gas_pressed"),
        ("POWERTRAIN_DATA", {"BRAKE_PRESSED": 1}, "brake_pressed"),
        ("POWERTRAIN_DATA", {"ACC_STATUS": 1}, "cruise_enabled"),
        ("SEATBELT_STATUS", {"SEATBELT_DRIVER_LATCHED": 0}, "seatbelt_unlatched"),
        ("DOORS_STATUS", {"DOOR_OPEN_RL": 1}, "door_open"),
        ("VSA_STATUS", {"ESP_DISABLED": 1}, "esp_disabled"),
        ("VSA_STATUS", {"BRAKE_HOLD_ACTIVE": 1}, "brake_hold"),
        ("EPB_STATUS", {"EPB_STATE": 1}, "park_brake"),
        ("STANDSTILL", {"BRAKE_ERROR_2": 1}, "brake_error"),
        ("SCM_FEEDBACK", {"LEFT_BLINKER": 1}, "left_blinker"),
        ("SCM_FEEDBACK", {"RIGHT_BLINKER": 1}, "right_blinker"),
        ("STEER_STATUS", {"STEER_TORQUE_SENSOR": -1201}, "steering_pressed"),
        ("STEER_STATUS", {"STEER_STATUS": 6}, "steer_not_allowed"),
        ("STEER_STATUS", {"STEER_STATUS": 5}, "steer_error"),
    ],
)
def test_each_signal_sets_its_field(reader, bench, name, signals, field):
    assert not getattr(read(reader, bench), field)
    assert getattr(reader.update([pack(name, 1, **signals)], 0.01), field)


def test_the_brake_switch_must_be_on_for_two_frames(reader, bench):
    read(reader, bench)
    assert not reader.update([pack("POWERTRAIN_DATA", 1, BRAKE_SWITCH=1)], 0.01).brake_pressed
    assert reader.update([pack("POWERTRAIN_DATA", 2, BRAKE_SWITCH=1)], 0.02).brake_pressed


@pytest.mark.parametrize(
    ("code", "gear"), [(1, "park"), (2, "reverse"), (4, "neutral"), (8, "drive"), (63, "unknown")]
)
def test_gear_codes(reader, code, gear):
    assert reader.update([pack("GEARBOX", 0, GEAR_SHIFTER=code)], 0.0).gear == gear
