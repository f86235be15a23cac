"""The readers of trace files: one module for each suffix, with an `IMPORTER`."""
