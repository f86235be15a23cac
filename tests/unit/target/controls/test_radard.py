"""radard agrees with numbers measured on openpilot, and selects leads."""

import pytest
from selfdrive.common.car import CarParams
from selfdrive.controls.lib.pathplanner import ModelFit
from selfdrive.controls.radard import Radard
from selfdrive.messages import (
    ControlsState,
    LeadVision,
    ModelData,
    PathData,
    RadarData,
    RadarPoint,
    RadarState,
)

# Speed estimate and relative speed at the first radar cycles of S1.
V_EGO = (8.9334, 18.747, 24.391, 27.505, 29.103, 29.806)
V_REL = (-8.90625, -8.875, -8.875, -8.875, -8.875, -8.84375)


def line(y: float) -> PathData:
    return PathData((y,) * 50, 1.0, 1.0)


def model(lead_d_rel: float = 50.0, path: float = 0.0) -> ModelData:
    lanes = line(path), line(1.85 + path), line(-1.85 + path)
    return ModelData(0.0, *lanes, LeadVision(lead_d_rel, 1.0, 0.1))


def point(track_id: int = 1, d_rel: float = 50.0, y_rel: float = 0.0, v_rel: float = 0.0) -> RadarPoint:
    return RadarPoint(track_id, d_rel, y_rel, v_rel)


class Drive:
    """Runs radard on a straight road at 20 m/s."""

    def __init__(self, params: CarParams, **controls) -> None:
        self.radard = Radard(params, ModelFit())
        self.controls = ControlsState(**{"v_ego": 20.0, "active": True, **controls})

    def see(self, *points: RadarPoint, vision: ModelData | None = None, cycles: int = 1) -> RadarState:
        for _ in range(cycles):
            state = self.radard.update(RadarData(1.0, points), vision or model(), self.controls)
        return state


def test_the_first_lead_speeds_agree_with_openpilot(params: CarParams) -> None:
    """There is no lead in the first 0.1 s, while the earlier speeds are unknown. After that, the filtered
    speeds match openpilot's."""
    radard = Radard(params, ModelFit())
    leads = []
    for v_ego, v_rel in zip(V_EGO, V_REL, strict=True):
        radar = RadarData(0.0, (point(d_rel=97.0, v_rel=v_rel),))
        leads.append(radard.update(radar, model(97.0), ControlsState(v_ego=v_ego)).lead_one)
    assert [lead.status for lead in leads] == [False, False, True, True, True, True]
    assert [lead.v_lead_k for lead in leads[2:]] == pytest.approx(
        [-7.118, -3.6109, 0.56376, 4.8068], abs=2e-4
    )
    assert [lead.a_lead_k for lead in leads[2:]] == pytest.approx([2.567, 7.4186, 12.88, 18.048], abs=1e-3)


def test_distance_is_from_the_bumper(params: CarParams) -> None:
    assert Drive(params).see(point(d_rel=42.5)).lead_one.d_rel == pytest.approx(42.5)


def test_the_two_closest_separate_vehicles_on_the_path_are_the_leads(params: CarParams) -> None:
    drive = Drive(params)
    state = drive.see(point(1, 70.0), point(2, 40.0), point(3, 43.0), point(4, 20.0, y_rel=3.0), cycles=3)
    assert state.lead_one.d_rel == pytest.approx(40.0)
    assert state.lead_two.d_rel == pytest.approx(70.0)


def test_a_vehicle_off_the_path_is_not_a_lead(params: CarParams) -> None:
    drive = Drive(params)
    assert drive.see(point(), cycles=3).lead_one.status
    assert not drive.see(point(), vision=model(path=2.0), cycles=3).lead_one.status


def test_the_steering_angle_gives_the_path_while_the_driver_steers(params: CarParams) -> None:
    straight = {"steering_angle": 0.5}
    assert Drive(params, **straight).see(point(), cycles=3).lead_one.status
    assert not Drive(params, active=False, **straight).see(point(), cycles=3).lead_one.status
    assert not Drive(params, steer_override=True, **straight).see(point(), cycles=3).lead_one.status


@pytest.mark.parametrize("steered", [False, True])
def test_leads_get_no_lateral_speed_while_the_driver_steers(params: CarParams, steered: bool) -> None:
    drive = Drive(params, steer_override=steered)
    for k in range(20):
        lead = drive.see(point(y_rel=0.05 * k)).lead_one
    assert (lead.v_lat == 0.0) is steered


def test_a_stationary_vehicle_is_a_lead_only_with_the_camera(params: CarParams) -> None:
    drive = Drive(params)
    drive.see(point(9, 90.0), cycles=4)  # the speed history fills
    standing = point(v_rel=-20.0)
    for _ in range(5):
        assert not drive.see(standing, vision=model(90.0)).lead_one.status
    closing = [
        drive.see(point(d_rel=50.0 - k, v_rel=-20.0), vision=model(50.0 - k)).lead_one.status
        for k in range(20)
    ]
    assert not any(closing[:2]) and closing[-1]


def test_a_lead_can_cause_warnings_after_twenty_fusions(params: CarParams) -> None:
    drive = Drive(params)
    assert not drive.see(point(), cycles=19).lead_one.fcw
    assert drive.see(point(), cycles=2).lead_one.fcw


def test_a_lost_track_loses_its_fusions(params: CarParams) -> None:
    drive = Drive(params)
    drive.see(point(), cycles=30)
    assert not drive.see().lead_one.status
    lead = drive.see(point()).lead_one
    assert not lead.fcw and lead.status


def test_errors_and_time_are_passed_on(params: CarParams) -> None:
    state = Radard(params, ModelFit()).update(RadarData(3.5, (), ("fault",)), None, ControlsState())
    assert (state.t, state.errors) == (3.5, ("fault",))
