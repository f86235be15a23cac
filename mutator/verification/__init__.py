"""Checks that results are valid: preflight, equivalence check, library check, doctor.

This package does not change results.
"""
