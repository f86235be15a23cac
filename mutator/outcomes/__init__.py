"""What a run came to: golden runs, differences from them, verdicts, and the table of results.

Nothing here runs anything or compares two campaigns.
"""
