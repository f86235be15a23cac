"""Lengths of steps in s."""

DT_CTRL = 0.01
DT_MDL = 0.05
