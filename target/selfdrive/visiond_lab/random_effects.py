"""Image effects for training: a random one, at a random level, or none."""

import numpy as np

from selfdrive.common.camera_model import CameraModel
from selfdrive.sim.effects.effect import Effect, Moment
from selfdrive.sim.effects.levels import AMOUNTS_BY_EFFECT

CLEAN_SHARE = 0.3  # of the pictures, which get no effect
KINDS = tuple(AMOUNTS_BY_EFFECT)


def random_effect(
    model: CameraModel, rng: np.random.Generator, clean_share: float = CLEAN_SHARE
) -> Effect | None:
    if rng.random() < clean_share:
        return None
    kind = KINDS[int(rng.integers(len(KINDS)))]
    amounts = AMOUNTS_BY_EFFECT[kind]
    return kind(amounts[int(rng.integers(len(amounts)))], int(rng.integers(2**31)), model)


def random_moment(rng: np.random.Generator) -> Moment:
    return Moment(rng.uniform(0.0, 30.0), rng.uniform(0.0, 800.0), 26.82)
