"""Checks of a run folder after the run: that files are unchanged and follow from each other; repair; seals.

Audits only read. Only `repair` and `series_repair` change a run folder, and results stay as they are.
"""
