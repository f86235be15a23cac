"""Compares two runs of the same faults, experiment by experiment. Runs nothing and writes nothing to run
folders."""
