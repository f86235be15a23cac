"""The outcome of a run: golden runs, differences from them, verdicts, and the table of results.

Nothing here runs anything or compares two campaigns.
"""
