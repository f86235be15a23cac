"""Compares two runs of the same faults by experiment. Runs no experiment and writes to no run folder."""
