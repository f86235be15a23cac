"""Decides whether the cars collided."""


def collided(truth):
    hit = truth.gap <= 0.0
    return hit
