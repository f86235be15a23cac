"""Longitudinal motion agrees with numbers measured on openpilot's plant."""

import pytest
from selfdrive.car.honda.interface import get_params
from selfdrive.messages import Actuators
from selfdrive.sim.plant import BASE_SPEED, Plant, longitudinal_acceleration


@pytest.fixture
def plant():
    def make(speed):
        return Plant(get_params(), speed=speed)

    return make


def test_coasting_from_60_mph(plant):
    """The first steps of a coasting car match openpilot's to all printed digits."""
    car = plant(26.8224)
    car.step(Actuators(), 0.0, 0.0)
    assert (car.position, car.speed, car.acceleration) == pytest.approx((0.26822, 26.821, -0.17586), abs=6e-4)
    for _ in range(100):
        car.step(Actuators(), 0.0, 0.0)
    assert (car.position, car.speed, car.acceleration) == pytest.approx((27.002, 26.645, -0.17485), abs=6e-4)


def test_position_uses_the_old_speed(plant):
    """The plant uses Euler's method."""
    car = plant(10.0)
    car.step(Actuators(brake=1.0), 0.0, 0.0)
    assert car.position == 0.1
    assert car.speed == 10.0 + 0.01 * car.acceleration


def test_gas_below_and_above_base_speed():
    assert abs(BASE_SPEED - 19.608) < 1e-3
    for speed, force in ((10.0, 5100 * 3.33), (25.0, 100_000 / 25.0 * 3.33)):
        gain = longitudinal_acceleration(speed, 0.5, 0.0, 0.0) - longitudinal_acceleration(
            speed, 0.0, 0.0, 0.0
        )
        assert gain == pytest.approx(0.5 * force / 1700)


def test_brake_and_grade():
    free = longitudinal_acceleration(15.0, 0.0, 0.0, 0.0)
    assert free - longitudinal_acceleration(15.0, 0.0, 1.0, 0.0) == pytest.approx(3.0)
    assert free - longitudinal_acceleration(15.0, 0.0, 0.0, 1.0) == pytest.approx(1.0)


def test_extra_deceleration_brakes_up_to_its_limit():
    """A driver or an emergency brake brakes beside the controller; the stronger demand counts."""

    def braking(brake, extra):
        free = longitudinal_acceleration(15.0, 0.0, 0.0, 0.0)
        return free - longitudinal_acceleration(15.0, 0.0, brake, 0.0, extra)

    assert braking(0.0, 6.0) == pytest.approx(6.0)
    assert braking(1.0, 6.0) == pytest.approx(6.0)
    assert braking(1.0, 2.0) == pytest.approx(3.0)
    assert braking(0.0, 12.0) == pytest.approx(9.0)


@pytest.mark.parametrize("extra", [0.0, -1.0, float("nan")])
def test_without_extra_deceleration_the_brake_alone_counts(extra):
    for k in range(100):
        speed, brake = 0.4 * k, 0.01 * k
        alone = longitudinal_acceleration(speed, 0.1, brake, 0.3)
        assert longitudinal_acceleration(speed, 0.1, brake, 0.3, extra) == alone


def test_creep():
    """The idling engine accelerates the car at 1 m/s^2 at rest and not at all at 1.5 m/s. Rolling resistance
    is subtracted."""
    assert longitudinal_acceleration(0.0, 0.0, 0.0, 0.0) == pytest.approx(1.0 - 0.0981)
    assert longitudinal_acceleration(0.75, 0.0, 0.0, 0.0) == pytest.approx(0.5 - 0.0981, abs=1e-3)
    assert longitudinal_acceleration(1.5, 0.0, 0.0, 0.0) == pytest.approx(-0.0981, abs=1e-3)


def test_the_car_never_drives_backwards(plant):
    car = plant(1.0)
    for _ in range(200):
        car.step(Actuators(brake=1.0), 0.0, 0.0)
    stopped_at = car.position
    car.step(Actuators(brake=1.0), 0.0, 0.0)
    assert (car.speed, car.acceleration, car.position) == (0.0, 0.0, stopped_at)


def test_position_is_measured_along_the_road(plant):
    straight, askew, outside = plant(20.0), plant(20.0), plant(20.0)
    askew.lateral.heading = 0.5
    outside.lateral.offset = -2.0
    straight.step(Actuators(), 0.0, 0.0)
    askew.step(Actuators(), 0.0, 0.0)
    outside.step(Actuators(), 0.0, 0.01)
    assert askew.position == pytest.approx(straight.position * 0.87758, rel=1e-4)
    assert outside.position == pytest.approx(straight.position / 1.02, rel=1e-9)
