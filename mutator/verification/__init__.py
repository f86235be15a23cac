"""Checks that results are valid: preflight, equivalence check, library check, doctor.

This package changes no result.
"""
