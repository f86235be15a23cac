"""A car's parameters for the control tests."""

import pytest
from selfdrive.car.params import CarParams
from selfdrive.common.conversions import RAD_TO_DEG


@pytest.fixture
def params() -> CarParams:
    """A mid-size car with the gains of the Civic."""
    return CarParams(
        name="test car",
        mass=1461.6,
        wheelbase=2.70,
        center_to_front=1.08,
        steer_ratio=13.0,
        rotational_inertia=2500.0,
        tire_stiffness_front=85400.0,
        tire_stiffness_rear=90000.0,
        steer_kp=((0.0,), (0.8 * RAD_TO_DEG,)),
        steer_ki=((0.0,), (0.24 * RAD_TO_DEG,)),
        steer_kf=0.00006 * RAD_TO_DEG,
        steer_max=1.0,
        steer_actuator_delay=0.1,
        steer_rate_cost=0.5,
        long_kp=((0.0, 5.0, 35.0), (3.6, 2.4, 1.5)),
        long_ki=((0.0, 35.0), (0.54, 0.36)),
        gas_max=((0.0,), (0.6,)),
        brake_max=((5.0, 20.0), (1.0, 0.8)),
        acceleration_per_output=4.8,
        radar_offset=2.7,
        steer_limit_alert=True,
    )
