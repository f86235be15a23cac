"""Leads, lanes and solvers for the tests of the model-predictive controllers."""

import pytest
from selfdrive.car.honda.interface import get_params
from selfdrive.controls.lib.lateral_mpc import Lanes, LateralMpc
from selfdrive.controls.lib.long_mpc import LongitudinalMpc
from selfdrive.messages import LeadData


@pytest.fixture(scope="session")
def long_solver():
    return LongitudinalMpc(1).solver


@pytest.fixture
def make_long(long_solver):
    return lambda: LongitudinalMpc(1, long_solver)


@pytest.fixture
def long_mpc(make_long):
    return make_long()


@pytest.fixture(scope="session")
def _lateral_mpc():
    return LateralMpc(get_params())


@pytest.fixture
def lateral_mpc(_lateral_mpc):
    _lateral_mpc.reset()
    return _lateral_mpc


@pytest.fixture
def lead():
    def make(d_rel, v_lead, a_lead=0.0):
        return LeadData(status=True, d_rel=d_rel, v_lead=v_lead, a_lead_k=a_lead)

    return make


@pytest.fixture
def lanes():
    """Build straight lanes of 3.7 m with the middle `offset` m to the left, rotated by `slope`."""

    def make(offset=0.0, slope=0.0, left_prob=1.0, right_prob=1.0):
        lines = [(0.0, 0.0, slope, offset + y) for y in (1.85, -1.85, 0.0)]
        return Lanes(*lines, left_prob, right_prob, 3.7)

    return make
