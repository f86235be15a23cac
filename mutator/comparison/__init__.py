"""Compares two runs of the same faults, experiment by experiment. This package runs nothing and does not
change run folders.
"""
