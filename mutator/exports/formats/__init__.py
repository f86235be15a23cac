"""The formats of `mutator export`: one module for each, with an `EXPORT`."""
