"""The conditions for valid results: preflight, equivalence check, library check, doctor. Changes no
result."""
