"""The hazard analysis: context tables, unsafe control actions, checks, coverage, drawings.

This package does not run targets or read results.
"""
