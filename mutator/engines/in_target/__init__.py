"""What runs inside a target's process.

These modules use the standard library and numpy only, and are started as scripts: nothing of the harness may
change what a target does.
"""
