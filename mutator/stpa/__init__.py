"""The hazard analysis: context tables, unsafe control actions, checks, coverage and drawings.

This package does not run targets or read results.
"""
