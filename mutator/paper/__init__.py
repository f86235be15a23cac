"""A published study that the library reproduces: its tables, observations and figures beside those of a run.

Nothing else in the harness imports this package; it is found by its entry point in `mutator.studies`.
"""
