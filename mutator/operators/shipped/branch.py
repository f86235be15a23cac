"""Negate a condition, or decide it in advance."""

import ast
from collections.abc import Iterator

from mutator.model import AnchorKind
from mutator.mutants.changeable_expressions import Expression
from mutator.operators import MutationRule, Operator, mutation_rule
from mutator.operators.statement_facts import StatementFacts


def _rules(expression: Expression, facts: StatementFacts) -> Iterator[MutationRule]:
    if not expression.matches_anchor(AnchorKind.CONDITION, "", None):
        return
    yield mutation_rule("operator_prefix", to="not")
    if not any(isinstance(inner, ast.NamedExpr) for inner in ast.walk(expression.node)):
        yield mutation_rule("operator_constant", to=True)
        yield mutation_rule("operator_constant", to=False)


OPERATOR = Operator(
    about="a condition that is negated, always true or always false",
    replacements=(
        (
            "the condition of an `if`, `while`, `assert`, `a if c else b`, or of a comprehension",
            "`not c`, `True`, `False`; only `not c` if `c` sets a name (`:=`), because a constant would not "
            "set it",
        ),
    ),
    rules=_rules,
    examples={
        "if a: return b": ["a -> not a", "a -> True", "a -> False"],
        "return b if a else c": ["a -> not a", "a -> True", "a -> False"],
        "return [b for b in c if a]": ["a -> not a", "a -> True", "a -> False"],
        "if (c := a) > b: return c": ["(c := a) > b -> not ((c := a) > b)"],
        "return a": [],
    },
)
