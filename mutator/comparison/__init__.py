"""Compares two runs of the same faults, experiment by experiment. It runs no experiments and does not write
to run folders."""
