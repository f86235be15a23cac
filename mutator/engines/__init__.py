"""Run a target once: the reference engine, and faster engines.

This package does not interpret a run's output.
"""
