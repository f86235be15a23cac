"""Swap two neighbouring positional arguments of a call, or drop a keyword argument."""

import ast
from collections.abc import Iterator

from mutator.mutants.changeable_expressions import Expression
from mutator.operators import MutationRule, Operator, mutation_rule
from mutator.operators.statement_facts import StatementFacts


def _rules(expression: Expression, facts: StatementFacts) -> Iterator[MutationRule]:
    node = expression.node
    if not isinstance(node, ast.Call):
        return
    starred = (number for number, argument in enumerate(node.args) if isinstance(argument, ast.Starred))
    for first in range(1, next(starred, len(node.args))):
        yield mutation_rule("operator_swap", first=first)
    for number, keyword in enumerate(node.keywords, len(node.args) + 1):
        if keyword.arg is not None:
            yield mutation_rule("operator_drop", place=number)


OPERATOR = Operator(
    about="swapped or missing arguments of a call",
    replacements=(
        ("two neighbouring positional arguments of a call", "swapped"),
        ("a keyword argument", "dropped"),
    ),
    rules=_rules,
    examples={
        "a(b, c)": ["a(b, c) -> a(c, b)"],
        "a(b, c=1, d=2)": ["a(b, c=1, d=2) -> a(b, d=2)", "a(b, c=1, d=2) -> a(b, c=1)"],
        "a(*b, c)": [],
        "a(b)": [],
    },
)
