"""What the harness knows about a controller: its manifest, observed values, channels and source tree.

This package does not import, run or change a target's code.
"""
