"""Checks of a machine, a library and a target, without a campaign: `mutator doctor` and `mutator check`.

The results are findings: each says what was checked, whether it is in order, and what to do.
"""
