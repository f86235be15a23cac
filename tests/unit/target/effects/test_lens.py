"""Mud on the lens."""

import numpy as np
import pytest
from selfdrive.sim.effects import LensMud


@pytest.mark.parametrize("coverage", [0.0, 0.1, 0.5])
def test_mud_covers_its_share(coverage, camera, moment):
    """The amount is the share of light lost, apart from the mud's own brightness."""
    mud = LensMud(coverage, 0, camera)
    flat = np.full((camera.rows, camera.width), 255, np.uint8)
    dark = np.zeros_like(flat)
    through = (mud.apply(flat, moment()).astype(float) - mud.apply(dark, moment())) / 255.0
    assert 1.0 - through.mean() == pytest.approx(coverage, abs=0.01)


def test_more_mud_holds_all_of_less(camera, moment):
    less, more = (LensMud(coverage, 0, camera).ready()._open.astype(int) for coverage in (0.1, 0.4))
    assert (more <= less).all()
