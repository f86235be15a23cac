"""The published study that the library reproduces: shows its tables, observations and figures next to those
of a run.

No other package imports this one. An entry point in `mutator.studies` registers it.
"""
