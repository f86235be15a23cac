"""A car's parameters for the control tests."""

import pytest
from selfdrive.car.honda.interface import get_params
from selfdrive.car.params import CarParams


@pytest.fixture
def params() -> CarParams:
    return get_params()
