"""The command line: each verb reads its options, calls the public API and prints what came of it.

Nothing that a Python program might want is decided here.
"""
