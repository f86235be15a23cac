"""Scripts that run inside a target's process.

They use only the standard library and numpy, because the harness must not change what a target does.
"""
