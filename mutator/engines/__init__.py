"""How to run a target once: the reference engine, and faster ones.

This package does not interpret a run's output.
"""
