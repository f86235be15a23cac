"""Conditions and formulas as JSON, which the report's page evaluates.

A number, truth value or name (also `t` and `inf`) is written as itself. Anything else is a list of an
operator and its operands: `+ - * / neg abs hypot min max rate`, `< <= > >= == !=`, `and or not ever`, and
`if` with a condition and two numbers.
"""

import ast
from collections.abc import Mapping
from typing import Any

from mutator.triggers.conditions import parse_expression

JsonTree = bool | float | str | list[Any]

_OPERATOR_SIGNS: Mapping[type[ast.AST], str] = {
    ast.Add: "+",
    ast.Sub: "-",
    ast.Mult: "*",
    ast.Div: "/",
    ast.Lt: "<",
    ast.LtE: "<=",
    ast.Gt: ">",
    ast.GtE: ">=",
    ast.Eq: "==",
    ast.NotEq: "!=",
    ast.And: "and",
    ast.Or: "or",
    ast.Not: "not",
    ast.USub: "neg",
}


def formula_as_json(text: str, derived: Mapping[str, str]) -> JsonTree:
    """Return the tree of a checked condition or formula; `derived` values are replaced by their formulas."""
    return _node_as_json(parse_expression(text), derived)


def _node_as_json(node: ast.expr, derived: Mapping[str, str]) -> JsonTree:
    if isinstance(node, ast.Constant):
        return node.value if isinstance(node.value, bool) else float(node.value)  # type: ignore[arg-type]
    if isinstance(node, ast.Name):
        return formula_as_json(derived[node.id], derived) if node.id in derived else node.id
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.UAdd):
        return _node_as_json(node.operand, derived)
    name, parts = _operator_and_operands(node)
    return [name, *(_node_as_json(part, derived) for part in parts)]


def _operator_and_operands(node: ast.expr) -> tuple[str, list[ast.expr]]:
    if isinstance(node, ast.BoolOp):
        return _OPERATOR_SIGNS[type(node.op)], node.values
    if isinstance(node, ast.UnaryOp):
        return _OPERATOR_SIGNS[type(node.op)], [node.operand]
    if isinstance(node, ast.BinOp):
        return _OPERATOR_SIGNS[type(node.op)], [node.left, node.right]
    if isinstance(node, ast.IfExp):
        return "if", [node.test, node.body, node.orelse]
    if isinstance(node, ast.Call):
        return ast.unparse(node.func), node.args
    assert isinstance(node, ast.Compare)
    if len(node.ops) == 1:
        return _OPERATOR_SIGNS[type(node.ops[0])], [node.left, *node.comparators]
    terms = [node.left, *node.comparators]  # a < b < c
    pairs = zip(terms, node.ops, terms[1:], strict=False)
    return "and", [ast.Compare(left, [op], [right]) for left, op, right in pairs]
