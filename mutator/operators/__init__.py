"""Mutation operators: the classical mutants of a target's functions, as faults, without a spec.

They are found in the source, left out where a golden run never comes to their lines or where their code is
another's, and drawn. `docs/reference/operators.md` lists them.
"""
