"""The messages that sensors and radar send on the bus."""

import cantools
import pytest
from selfdrive.car.honda.values import CAR_DBC, RADAR_DBC
from selfdrive.sim.radar import RadarSensor
from selfdrive.sim.road import Road
from selfdrive.sim.sensors import CarSensors

CAR = cantools.database.load_file(CAR_DBC)
RADAR = cantools.database.load_file(RADAR_DBC)


def read(database, frames):
    return {
        database.get_message_by_frame_id(f.address).name: database.decode_message(
            f.address, f.data, decode_choices=False
        )
        for f in frames
    }


def test_cantools_reads_the_true_speed_and_angle(truth):
    frames = CarSensors().measure(truth(v_ego=20.0, steer_angle=-0.1, steer_rate=0.2), 3, 0)
    values = read(CAR, frames)
    assert values["ENGINE_DATA"]["XMISSION_SPEED"] == pytest.approx(72.0)
    for corner in ("FL", "FR", "RL", "RR"):
        assert values["WHEEL_SPEEDS"][f"WHEEL_SPEED_{corner}"] == pytest.approx(72.0)
    assert values["STEERING_SENSORS"]["STEER_ANGLE"] == pytest.approx(-5.7)
    assert values["STEERING_SENSORS"]["STEER_ANGLE_RATE"] == pytest.approx(11.0)
    assert values["SCM_BUTTONS"]["CRUISE_BUTTONS"] == 3


@pytest.mark.parametrize(("speed", "shown"), [(0.29999, 0.0), (0.3, 1.08), (0.0, 0.0)])
def test_speed_reads_zero_below_its_threshold(truth, speed, shown):
    values = read(CAR, CarSensors().measure(truth(v_ego=speed), 0, 0))
    assert values["ENGINE_DATA"]["XMISSION_SPEED"] == pytest.approx(shown)
    assert values["STANDSTILL"]["WHEELS_MOVING"] == (speed > 0)


def test_every_message_has_its_period_and_counter(truth):
    sensors, seen = CarSensors(), {}
    for frame in range(100):
        for name, values in read(CAR, sensors.measure(truth(v_ego=0.1 * frame), 0, frame)).items():
            seen.setdefault(name, []).append(values.get("COUNTER"))
    assert {len(counters) for counters in seen.values()} == {100, 50, 10}
    for name, counters in seen.items():
        if name != "WHEEL_SPEEDS":
            assert counters == [k % 4 for k in range(len(counters))], name


def test_the_controller_reads_a_pressed_brake_pedal(truth):
    """Only the pedals' message differs, and nothing differs while the pedal is released."""
    released, pressed = (CarSensors().measure(truth(v_ego=20.0), 0, 3, pedal) for pedal in (0.0, 1.0))
    assert released == CarSensors().measure(truth(v_ego=20.0), 0, 3)
    [(before, after)] = [pair for pair in zip(released, pressed, strict=True) if pair[0] != pair[1]]
    assert [read(CAR, [frame])["POWERTRAIN_DATA"]["BRAKE_PRESSED"] for frame in (before, after)] == [0, 1]
    assert read(CAR, [after])["POWERTRAIN_DATA"]["COUNTER"] == 3


def radar(truth, road=None, **values):
    frames = RadarSensor(road or Road(None, None)).measure(truth(**values))
    return read(RADAR, frames)["TRACK_15"]


def test_radar_values_are_truncated_towards_zero(truth):
    track = radar(truth, d_rel=97.681, v_ego=26.777, v_lead=17.8868)
    assert (track["LONG_DIST"], track["REL_SPEED"]) == (97.625, -8.875)


@pytest.mark.parametrize(("d_rel", "read_as"), [(255.99, 255.9375), (256.0, 0.0), (317.0, 61.0), (-5.0, 0.0)])
def test_radar_distance_wraps(truth, d_rel, read_as):
    """The twelve bits of 1/16 m wrap around at 256 m. A lead behind the bumper reads 0."""
    assert radar(truth, d_rel=d_rel)["LONG_DIST"] == read_as


def test_the_radar_reports_the_leads_lateral_position(truth):
    """The lead stays in its lane, so it moves right (positive) when the car drifts or turns left."""
    assert radar(truth, d_rel=50.0, lateral_offset=1.0)["LAT_DIST"] == 1.0
    assert radar(truth, d_rel=50.0, heading=0.1)["LAT_DIST"] == pytest.approx(4.99, abs=0.0625)
    left_bend = Road(None, ((0.0,), (0.002,)))
    assert radar(truth, left_bend, d_rel=50.0)["LAT_DIST"] == pytest.approx(-2.5, abs=0.0625)
    assert radar(truth, left_bend, d_rel=250.0)["LAT_DIST"] == -31.0


def test_nan_and_infinite_measurements_are_sent_as_zero():
    sensor = RadarSensor(Road(None, None))
    track = read(RADAR, sensor._pack(float("nan"), float("inf"), 0.0))["TRACK_15"]
    assert (track["LONG_DIST"], track["REL_SPEED"]) == (0.0, 0.0)
