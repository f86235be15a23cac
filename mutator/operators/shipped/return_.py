"""Replace the value that a function returns."""

import ast
from collections.abc import Iterator

from mutator.model import AnchorKind
from mutator.mutants.changeable_expressions import Expression
from mutator.operators import MutationRule, Operator, mutation_rule
from mutator.operators.statement_facts import StatementFacts

_NODES_AND_EMPTY_LITERAL: tuple[tuple[tuple[type[ast.expr], ...], str], ...] = (
    ((ast.List, ast.ListComp), "[]"),
    ((ast.Dict, ast.DictComp), "{}"),
    ((ast.Set, ast.SetComp), "set()"),
    ((ast.Tuple,), "()"),
)


def _rules(expression: Expression, facts: StatementFacts) -> Iterator[MutationRule]:
    node = expression.node
    if not expression.matches_anchor(AnchorKind.RETURN_VALUE, "", None) or _is_constant(node, type(None)):
        return
    yield mutation_rule("operator_constant", to=None)
    for kinds, empty in _NODES_AND_EMPTY_LITERAL:
        if isinstance(node, kinds):
            yield mutation_rule("operator_empty", to=empty)
            return
    if _is_constant(node, str):
        yield mutation_rule("operator_empty", to="''")
    elif isinstance(node, ast.Compare | ast.BoolOp) or _has_prefix(node, ast.Not):
        yield mutation_rule("operator_prefix", to="not")
    elif not (isinstance(node, ast.Constant | ast.Lambda) or _is_negative(node)):
        yield mutation_rule("operator_constant", to=0)
        yield mutation_rule("operator_prefix", to="-")


def _is_constant(node: ast.expr, *types: type) -> bool:
    return isinstance(node, ast.Constant) and isinstance(node.value, types)


def _has_prefix(node: ast.expr, prefix: type[ast.unaryop]) -> bool:
    return isinstance(node, ast.UnaryOp) and isinstance(node.op, prefix)


def _is_negative(node: ast.expr) -> bool:
    match node:
        case ast.UnaryOp(op=ast.USub(), operand=ast.Constant(value=int() | float())):
            return True
    return False


OPERATOR = Operator(
    about="another returned value",
    replacements=(
        ("any value except `None`", "`None`"),
        ("a list, dict, set, tuple or string", "also an empty one"),
        ("a comparison, `and`, `or`, `not`", "also its negation"),
        ("anything else except a number", "also 0, and the negated value"),
    ),
    rules=_rules,
    examples={
        "return a": ["a -> None", "a -> 0", "a -> -a"],
        "return a < b": ["a < b -> None", "a < b -> not (a < b)"],
        "return [a]": ["[a] -> None", "[a] -> []"],
        "return a, b": ["(a, b) -> None", "(a, b) -> ()"],
        "return {}": ["{} -> None"],
        "return 'a'": ["'a' -> None", "'a' -> ''"],
        "return 1": ["1 -> None"],
        "return -1": ["-1 -> None"],
        "return": [],
    },
)
