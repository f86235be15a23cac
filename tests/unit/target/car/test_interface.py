"""Events that the car raises."""

import pytest
from selfdrive.can.dbc import load_dbc
from selfdrive.can.packer import MessagePacker
from selfdrive.car.honda.interface import CarInterface
from selfdrive.car.honda.values import CAR_DBC, CruiseButton


@pytest.fixture
def car():
    return CarInterface()


def update(car, bench, **kw):
    frames = bench.frames(**kw)
    return car.update(frames, bench.t)


def pack(name, counter, **signals):
    return MessagePacker(load_dbc(CAR_DBC)[name], tuple(signals)).pack(tuple(signals.values()), counter)


def kinds(state):
    return {event.name: set(event.kinds) for event in state.events}


def test_no_events_without_cause(car, bench):
    assert update(car, bench, v_ego=20.0).events == ()


def test_can_error_comes_after_the_fifth_invalid_cycle(car, bench):
    for _ in range(11):
        update(car, bench)
    first = next(step for step in range(11, 60) if "can_error" in kinds(car.update([], step / 100)))
    assert first == 25
    assert kinds(car.update([], 0.6))["can_error"] == {"no_entry", "immediate_disable"}
    bench.frame = 70
    assert "can_error" not in kinds(update(car, bench))


@pytest.mark.parametrize("button", [CruiseButton.DECEL_SET, CruiseButton.RES_ACCEL])
def test_the_car_engages_when_the_button_is_released(car, bench, button):
    update(car, bench)
    assert update(car, bench, button=button).events == ()
    assert kinds(update(car, bench)) == {"button_enable": {"enable"}}


def test_the_car_disengages_when_cancel_is_pressed(car, bench):
    update(car, bench)
    assert kinds(update(car, bench, button=CruiseButton.CANCEL)) == {"button_cancel": {"user_disable"}}
    assert update(car, bench).events == ()


def test_the_gas_pedal_disengages_once_and_then_delays_engaging(car, bench):
    update(car, bench)
    first = car.update([pack("POWERTRAIN_DATA", 1, PEDAL_GAS=9)], 0.01)
    assert [e.kinds for e in first.events] == [("no_entry", "user_disable"), ("pre_enable",)]
    held = car.update([pack("POWERTRAIN_DATA", 2, PEDAL_GAS=9)], 0.02)
    assert [e.kinds for e in held.events] == [("pre_enable",)]


def test_the_brake_pedal_disengages(car, bench):
    update(car, bench, v_ego=20.0)
    for counter in (1, 2):
        state = car.update([pack("POWERTRAIN_DATA", counter, BRAKE_PRESSED=1)], 0.01 * counter)
        assert kinds(state) == {"pedal_pressed": {"no_entry", "user_disable"}}


@pytest.mark.parametrize(
    ("name", "signals", "event", "kind"),
    [
        ("GEARBOX", {"GEAR_SHIFTER": 4}, "wrong_gear", "soft_disable"),
        ("GEARBOX", {"GEAR_SHIFTER": 2}, "reverse_gear", "immediate_disable"),
        ("DOORS_STATUS", {"DOOR_OPEN_FL": 1}, "door_open", "soft_disable"),
        ("SEATBELT_STATUS", {"SEATBELT_DRIVER_LAMP": 1}, "seatbelt_not_latched", "soft_disable"),
        ("VSA_STATUS", {"ESP_DISABLED": 1}, "esp_disabled", "soft_disable"),
        ("VSA_STATUS", {"BRAKE_HOLD_ACTIVE": 1}, "brake_hold", "user_disable"),
        ("EPB_STATUS", {"EPB_STATE": 1}, "park_brake", "user_disable"),
        ("SCM_FEEDBACK", {"MAIN_ON": 0}, "wrong_car_mode", "user_disable"),
        ("STEER_STATUS", {"STEER_STATUS": 5}, "steer_unavailable", "immediate_disable"),
        ("STEER_STATUS", {"STEER_STATUS": 6}, "steer_temp_unavailable", "warning"),
        ("STANDSTILL", {"BRAKE_ERROR_1": 1}, "brake_unavailable", "immediate_disable"),
    ],
)
def test_each_condition_prevents_engaging_and_disengages(car, bench, name, signals, event, kind):
    update(car, bench)
    raised = kinds(car.update([pack(name, 1, **signals)], 0.01))
    assert {"no_entry", kind} <= raised[event]


def test_interfaces_do_not_share_state(bench):
    used, fresh = CarInterface(), CarInterface()
    for _ in range(20):
        frames = bench.frames(v_ego=20.0)
        used.update(frames, bench.t)
    assert fresh.update(frames, 0.0).v_ego == CarInterface().update(frames, 0.0).v_ego
