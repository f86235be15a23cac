"""Random effects for training."""

import numpy as np
from selfdrive.common.camera_model import CameraModel
from selfdrive.sim.effects.levels import AMOUNTS_BY_EFFECT
from selfdrive.visiond_lab.random_effects import random_effect


def test_all_effects_at_their_levels_are_drawn():
    rng, model = np.random.default_rng(0), CameraModel()
    effects = [random_effect(model, rng, clean_share=0.1) for _ in range(1000)]
    assert 60 < effects.count(None) < 140
    drawn = [effect for effect in effects if effect]
    assert {type(effect) for effect in drawn} == set(AMOUNTS_BY_EFFECT)
    assert all(effect.amount in AMOUNTS_BY_EFFECT[type(effect)] for effect in drawn)
