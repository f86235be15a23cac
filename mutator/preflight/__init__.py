"""Checks before and during a run: the null mutant, the canary, triggers that no run reaches, and equivalence.

A campaign has results only if they pass. The equivalence check runs a sample again on the reference engine.
"""
