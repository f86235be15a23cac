"""Gas and brake in every state of longitudinal control."""

import pytest
from selfdrive.common.car import CarParams
from selfdrive.controls.lib.longcontrol import OFF, PID, STARTING, STOPPING, LongControl
from selfdrive.messages import CarState, Plan


def plan(v: float, a: float = 0.0, future: float | None = None) -> Plan:
    return Plan(v_target=v, a_target=a, v_target_future=v if future is None else future)


def at(v: float, **state) -> CarState:
    return CarState(v_ego=v, **state)


def follow(control: LongControl, car: CarState, p: Plan, cycles: int = 1) -> tuple[float, float]:
    for _ in range(cycles):
        output = control.update(True, car, p)
    return output


def test_while_off_outputs_are_zero_and_the_target_follows_the_car(params: CarParams) -> None:
    control = LongControl(params)
    assert control.update(False, at(20.0), plan(30.0)) == (0.0, 0.0)
    assert (control.state, control.v_pid) == (OFF, 20.0)
    control.update(False, at(0.0), plan(30.0))
    assert control.v_pid == 0.3


@pytest.mark.parametrize(
    ("v_ego", "v_target", "a_target", "gas", "brake"),
    [
        (20.0, 20.0, 0.48, 0.1, 0.0),
        (20.0, 20.0, -0.96, 0.0, 0.2),
        (20.0, 21.0, 0.0, (1.95 + 0.0043714) / 4.8, 0.0),
        (20.0, 50.0, 0.0, 0.6, 0.0),
        (20.0, 0.0, 0.0, 0.0, 0.8),
        (4.0, 0.0, 0.0, 0.0, 1.0),
        (1.15, 1.15, 0.0, 0.0, 0.075),
    ],
)
def test_output_is_the_scaled_acceleration(
    params: CarParams, v_ego: float, v_target: float, a_target: float, gas: float, brake: float
) -> None:
    """The output is the acceleration divided by 4.8. Below 2.3 m/s, the loop also brakes to prevent
    creeping."""
    assert follow(LongControl(params), at(v_ego), plan(v_target, a_target)) == pytest.approx(
        (gas, brake), abs=1e-5
    )


def stopped(params: CarParams) -> LongControl:
    control = LongControl(params)
    follow(control, at(0.4), plan(0.2))
    follow(control, at(0.0, standstill=True), plan(0.2), 400)
    return control


def test_stopping_needs_low_speed_target_and_future(params: CarParams) -> None:
    for car, p in ((at(0.6), plan(0.2)), (at(0.4), plan(0.4)), (at(0.4), plan(0.2, future=0.4))):
        control = LongControl(params)
        follow(control, car, p, 2)
        assert control.state == PID
    control = LongControl(params)
    follow(control, at(0.4), plan(0.2), 2)
    assert control.state == STOPPING


def test_the_drivers_brake_also_starts_stopping(params: CarParams) -> None:
    control = LongControl(params)
    follow(control, at(0.4, brake_pressed=True), plan(5.0), 2)
    assert control.state == STOPPING


def test_the_brake_ramps_up_to_the_holding_value(params: CarParams) -> None:
    control = LongControl(params)
    follow(control, at(0.3), plan(0.2))
    start = control.output
    follow(control, at(0.3), plan(0.2), 101)
    assert control.output == pytest.approx(start - 0.2, abs=0.003)
    follow(control, at(0.3), plan(0.2), 250)
    assert control.output == pytest.approx(start - 0.7, abs=0.003)
    assert follow(stopped(params), at(0.0, standstill=True), plan(0.0)) == pytest.approx(
        (0.0, 0.5), abs=0.003
    )


def test_moving_off_releases_the_brake_first(params: CarParams) -> None:
    control = stopped(params)
    follow(control, at(0.0, standstill=True), plan(0.3, future=0.5))
    assert control.state == STOPPING
    states = []
    for _ in range(60):
        follow(control, at(0.0, standstill=True), plan(0.3, future=0.51))
        states.append(control.state)
    cycles = states.count(STARTING)
    assert states == [STARTING] * cycles + [PID] * (60 - cycles)
    assert cycles == pytest.approx(0.3 / 0.8 * 100, abs=2)


def test_moving_off_can_be_aborted(params: CarParams) -> None:
    control = stopped(params)
    follow(control, at(0.0, standstill=True), plan(0.3, future=1.0), 3)
    follow(control, at(0.0, standstill=True), plan(0.0))
    assert control.state == STOPPING


def test_reset_clears_the_integral(params: CarParams) -> None:
    control = LongControl(params)
    follow(control, at(20.0), plan(20.5), 300)
    control.reset(20.0)
    control.update(False, at(20.0), plan(20.0))
    assert follow(control, at(20.0), plan(20.0)) == (0.0, 0.0)


def test_stopping_does_not_wind_up(params: CarParams) -> None:
    control = LongControl(params)
    follow(control, at(0.4), plan(0.0), 1000)
    assert control.state == STOPPING
    assert control.output == -1.0
