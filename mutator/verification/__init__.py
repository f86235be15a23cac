"""The conditions for valid results: preflight, equivalence check, library check, doctor.

This package changes no result.
"""
