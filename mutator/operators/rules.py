"""Chooses the mutation rules for an expression, as listed in docs/reference/operators.md."""

import ast
from collections.abc import Iterator

from mutator.model import AnchorKind, Value
from mutator.mutants.expressions import Expression
from mutator.operators.mutations import Rule
from mutator.operators.names import Operator

_ARITHMETIC: dict[type[ast.operator], tuple[str, ...]] = {
    ast.Add: ("-", "*", "/"),
    ast.Sub: ("+", "*", "/"),
    ast.Mult: ("/", "+", "-"),
    ast.Div: ("*", "+", "-"),
    ast.FloorDiv: ("/", "*"),
    ast.Mod: ("//", "*"),
    ast.Pow: ("*", "/"),
    ast.MatMult: ("*",),
    ast.BitAnd: ("|", "^"),
    ast.BitOr: ("&", "^"),
    ast.BitXor: ("&", "|"),
    ast.LShift: (">>",),
    ast.RShift: ("<<",),
}
_COMPARISON: dict[type[ast.cmpop], tuple[str, ...]] = {
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
_AUGMENTED: dict[type[ast.operator], str] = {ast.Add: "-", ast.Sub: "-", ast.Mult: "1 /", ast.Div: "1 /"}
_EMPTY: tuple[tuple[tuple[type[ast.expr], ...], str], ...] = (
    ((ast.List, ast.ListComp), "[]"),
    ((ast.Dict, ast.DictComp), "{}"),
    ((ast.Set, ast.SetComp), "set()"),
    ((ast.Tuple,), "()"),
)
_NO_NUMBERS = (ast.List, ast.ListComp, ast.Dict, ast.Set, ast.Tuple, ast.JoinedStr)
_UNCALCULATED = (ast.Yield, ast.YieldFrom)


def rules_for(expression: Expression, augmented: ast.operator | None) -> Iterator[Rule]:
    """Yield the rules that fit an expression.

    `augmented`: the operator, if the expression is the right-hand side of an augmented assignment.
    """
    node = expression.node
    if any(isinstance(inner, _UNCALCULATED) for inner in ast.walk(node)):
        return  # templates refuse `yield`
    yield from _arithmetic(node, augmented)
    yield from _comparison(node)
    for value in _constants(node):
        yield _rule(Operator.CONSTANT, "operator_constant", to=value)
    if expression.answers(AnchorKind.CONDITION, "", None):
        yield _rule(Operator.BRANCH, "operator_prefix", to="not")
        if not any(
            isinstance(inner, ast.NamedExpr) for inner in ast.walk(node)
        ):  # replacing `:=` would leave its name unbound
            yield _rule(Operator.BRANCH, "operator_constant", to=True)
            yield _rule(Operator.BRANCH, "operator_constant", to=False)
    if expression.answers(AnchorKind.RETURN_VALUE, "", None):
        yield from _returned(node)
    if isinstance(node, ast.Call):
        yield from _called(node)


def _rule(operator: Operator, model: str, **params: Value) -> Rule:
    return Rule(operator=operator, model=model, params=tuple(sorted(params.items())))


def _infix(operator: Operator, to: str) -> Rule:
    return _rule(operator, "operator_infix", to=to)


def _arithmetic(node: ast.expr, augmented: ast.operator | None) -> Iterator[Rule]:
    operator = Operator.ARITHMETIC
    if isinstance(node, ast.BinOp) and _is_number(node.left) and _is_number(node.right):
        yield from (_infix(operator, to) for to in _ARITHMETIC[type(node.op)])
    match node:
        case ast.UnaryOp(op=ast.USub(), operand=operand) if not isinstance(operand, ast.Constant):
            yield _rule(operator, "operator_prefix", to="-")
    if augmented is not None and type(augmented) in _AUGMENTED and _is_number(node):
        yield _rule(operator, "operator_prefix", to=_AUGMENTED[type(augmented)])


def _is_number(node: ast.expr) -> bool:
    if isinstance(node, ast.Constant):
        return isinstance(node.value, int | float | complex)
    return not isinstance(node, _NO_NUMBERS)


def _comparison(node: ast.expr) -> Iterator[Rule]:
    operator = Operator.COMPARISON
    match node:
        case ast.Compare(ops=[link]):
            yield from (_infix(operator, to) for to in _COMPARISON[type(link)])
        case ast.BoolOp(op=link):
            yield _infix(operator, "or" if isinstance(link, ast.And) else "and")
        case ast.UnaryOp(op=ast.Not()):
            yield _rule(operator, "operator_prefix", to="not")


def _constants(node: ast.expr) -> list[Value]:
    """Return distinct replacements of a constant, with its type: 0, 1, -1, one more, one less, negated."""
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
    others: list[Value] = [kind(0), kind(1), kind(-1), number + 1, number - 1, -number]
    return [other for other in dict.fromkeys(others) if other != number]


def _returned(node: ast.expr) -> Iterator[Rule]:
    operator = Operator.RETURN
    if isinstance(node, ast.Constant) and node.value is None:
        return
    yield _rule(operator, "operator_constant", to=None)
    for kinds, empty in _EMPTY:
        if isinstance(node, kinds):
            yield _rule(operator, "operator_empty", to=empty)
            return
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        yield _rule(operator, "operator_empty", to="''")
    elif isinstance(node, ast.Compare | ast.BoolOp) or _is_denied(node):
        yield _rule(operator, "operator_prefix", to="not")
    elif not (isinstance(node, ast.Constant | ast.Lambda) or _constants(node)):
        yield _rule(operator, "operator_constant", to=0)
        yield _rule(operator, "operator_prefix", to="-")


def _is_denied(node: ast.expr) -> bool:
    return isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not)


def _called(node: ast.Call) -> Iterator[Rule]:
    """Yield rules that swap adjacent positional arguments, and rules that drop a keyword argument."""
    operator = Operator.ARGUMENT
    known = 0
    while known < len(node.args) and not isinstance(node.args[known], ast.Starred):
        known += 1
    for first in range(1, known):
        yield _rule(operator, "operator_swap", first=first)
    for place, keyword in enumerate(node.keywords, len(node.args) + 1):
        if keyword.arg is not None:
            yield _rule(operator, "operator_drop", place=place)
