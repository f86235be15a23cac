"""Replace a comparison or a logical operator."""

import ast
from collections.abc import Iterator

from mutator.mutants.changeable_expressions import Expression
from mutator.operators import MutationRule, Operator, mutation_rule
from mutator.operators.statement_facts import StatementFacts

# objects that are compared with `==` often have no order, so that `<` would only crash
_REPLACEMENTS_BY_OPERATOR: dict[type[ast.cmpop], tuple[str, ...]] = {
    ast.Lt: ("<=", ">", ">=", "==", "!="),
    ast.LtE: ("<", ">", ">=", "==", "!="),
    ast.Gt: (">=", "<", "<=", "==", "!="),
    ast.GtE: (">", "<", "<=", "==", "!="),
    ast.Eq: ("!=",),
    ast.NotEq: ("==",),
    ast.Is: ("is not",),
    ast.IsNot: ("is",),
    ast.In: ("not in",),
    ast.NotIn: ("in",),
}


def _rules(expression: Expression, facts: StatementFacts) -> Iterator[MutationRule]:
    match expression.node:
        case ast.Compare(ops=[link]):
            yield from (
                mutation_rule("operator_infix", to=to) for to in _REPLACEMENTS_BY_OPERATOR[type(link)]
            )
        case ast.BoolOp(op=link):
            yield mutation_rule("operator_infix", to="or" if isinstance(link, ast.And) else "and")
        case ast.UnaryOp(op=ast.Not()):
            yield mutation_rule("operator_prefix", to="not")


OPERATOR = Operator(
    about="another comparison, `and` instead of `or`, one more `not`",
    replacements=(
        ("`<`, `<=`, `>`, `>=`", "each of the other three, `==`, `!=`"),
        ("`==`, `is`, `in`", "`!=`, `is not`, `not in`, and vice versa"),
        (
            "`a and b`, `a or b`",
            "`a or b`, `a and b`; in a longer chain, only the last operator changes",
        ),
        ("`not a`", "`not (not a)`"),
    ),
    rules=_rules,
    examples={
        "return a < b": [f"a < b -> a {to} b" for to in ("<=", ">", ">=", "==", "!=")],
        "return a == b": ["a == b -> a != b"],
        "return a is not b": ["a is not b -> a is b"],
        "return a not in b": ["a not in b -> a in b"],
        "return a and b": ["a and b -> a or b"],
        "return a or b or c": ["a or b or c -> (a or b) and c"],
        "return not a": ["not a -> not (not a)"],
        "return a < b < c": [],
    },
)
