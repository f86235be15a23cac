"""A car's parameters for the control tests."""

import pytest
from selfdrive.car.honda.interface import get_params
from selfdrive.common.car import CarParams


@pytest.fixture
def params() -> CarParams:
    return get_params()
