"""Mutation operators: classical mutants of a target's functions, as faults without a spec.

`docs/reference/operators.md` lists the operators.
"""
