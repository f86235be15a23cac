"""The judgement of one run: golden runs, differences from them, metrics, the path of a fault, the verdict.

Nothing here knows about other experiments; `results` makes the table of all of them.
"""
