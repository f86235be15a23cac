"""Replace a number or a truth value with another of its type."""

import ast
from collections.abc import Iterator

from mutator.model import Value
from mutator.mutants.changeable_expressions import Expression
from mutator.operators import MutationRule, Operator, mutation_rule
from mutator.operators.statement_facts import StatementFacts


def _rules(expression: Expression, facts: StatementFacts) -> Iterator[MutationRule]:
    yield from (
        mutation_rule("operator_constant", to=value) for value in _replacement_values(expression.node)
    )


def _replacement_values(node: ast.expr) -> list[Value]:
    """Return distinct replacements of a constant: 0, 1, -1, one more, one less, negated."""
    sign = 1
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        sign, node = -1, node.operand
    value = node.value if isinstance(node, ast.Constant) else None
    if isinstance(value, bool):
        return [not value]
    if not isinstance(value, int | float):
        return []
    number = sign * value
    kind = type(number)
    values: list[Value] = [kind(0), kind(1), kind(-1), number + 1, number - 1, -number]
    return [other for other in dict.fromkeys(values) if other != number]


OPERATOR = Operator(
    about="another number or truth value",
    replacements=(
        ("a number `n`", "0, 1, -1, `n + 1`, `n - 1`, `-n`, each once, of the type of `n`"),
        ("`True`, `False`", "the other"),
    ),
    rules=_rules,
    examples={
        "return a[2]": ["2 -> 0", "2 -> 1", "2 -> -1", "2 -> 3", "2 -> -2"],
        "return 0": ["0 -> 1", "0 -> -1"],
        "return -0.5": ["-0.5 -> 0.0", "-0.5 -> 1.0", "-0.5 -> -1.0", "-0.5 -> 0.5", "-0.5 -> -1.5"],
        "return True": ["True -> False"],
        "return 'a'": [],
        "return None": [],
    },
)
