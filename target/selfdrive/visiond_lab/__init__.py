"""Training and evaluation of the lane detectors; no part of a run."""
