"""What must hold before results count: preflight, equivalence check, library check, doctor.

Nothing here changes a result.
"""
