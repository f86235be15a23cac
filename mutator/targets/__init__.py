"""What the harness knows about a controller: manifest, observed values, channels, source tree.

This package does not import, run or change a target's code.
"""
