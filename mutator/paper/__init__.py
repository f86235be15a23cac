"""The published study: its tables, observations and figures beside those of a run.

The rest of the harness does not know this package: it is found by its entry point in `mutator.studies`.
"""
