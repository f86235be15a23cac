"""What the harness knows of a controller: its manifest, observed values, channels and source tree.

Nothing here imports, runs or changes a target's code.
"""
