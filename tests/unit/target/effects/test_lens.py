"""Mud on the lens."""

import numpy as np
import pytest
from selfdrive.sim.effects import LensMud


@pytest.mark.parametrize("coverage", [0.0, 0.1, 0.5])
def test_the_amount_of_mud_is_the_share_of_light_lost(coverage, camera, moment):
    """The mud's own brightness is subtracted."""
    mud = LensMud(coverage, 0, camera)
    flat = np.full((camera.rows, camera.width), 255, np.uint8)
    dark = np.zeros_like(flat)
    through = (mud.apply(flat, moment()).astype(float) - mud.apply(dark, moment())) / 255.0
    assert 1.0 - through.mean() == pytest.approx(coverage, abs=0.01)


def test_more_mud_includes_the_mud_of_a_lower_amount(camera, moment):
    less, more = (LensMud(coverage, 0, camera).ready()._open.astype(int) for coverage in (0.1, 0.4))
    assert (more <= less).all()
