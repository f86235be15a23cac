"""A published study that the library reproduces: its tables, observations and figures next to those of a run.

Nothing imports this package; its entry point in `mutator.studies` registers it.
"""
