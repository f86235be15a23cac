"""The operators of the harness: one module for each, with an `OPERATOR`."""
