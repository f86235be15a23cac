"""Decides what was dangerous."""


def collided(truth):
    hit = truth.gap <= 0.0
    return hit
