"""Limits of a curvature."""

MOST_PER_M = 0.2


def clip_curvature(v_ego, prev_curvature, new_curvature, roll):
    curvature = max(-MOST_PER_M, min(MOST_PER_M, new_curvature))
    return curvature, curvature != new_curvature
