"""The outcome of a run: golden runs, differences from them, verdicts, and the results table."""
