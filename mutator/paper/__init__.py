"""Compares a run with the published study that the library reproduces: tables, observations, figures.

No other package imports this one. An entry point in `mutator.studies` registers it.
"""
