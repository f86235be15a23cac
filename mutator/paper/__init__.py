"""The published study that the library reproduces: its tables, observations and figures next to a run's.

No other package imports this one. An entry point in `mutator.studies` registers it.
"""
