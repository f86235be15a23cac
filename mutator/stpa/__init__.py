"""The hazard analysis: context tables, unsafe control actions, their checks, coverage and drawings.

Nothing here runs a target or looks at results.
"""
