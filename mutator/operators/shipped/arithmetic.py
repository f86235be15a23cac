"""Replace an arithmetic operator."""

import ast
from collections.abc import Iterator

from mutator.mutants.changeable_expressions import Expression
from mutator.mutants.expression_roles import FORMATTED_STRING_NODES
from mutator.operators import MutationRule, Operator, mutation_rule
from mutator.operators.statement_facts import StatementFacts, extent_of

_REPLACEMENTS_BY_OPERATOR: dict[type[ast.operator], tuple[str, ...]] = {
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
# the operator of `a += b` is no part of an expression, so `b` changes instead
_OPERAND_PREFIX_BY_OPERATOR: dict[type[ast.operator], str] = {
    ast.Add: "-",
    ast.Sub: "-",
    ast.Mult: "1 /",
    ast.Div: "1 /",
}
# another operator on these nearly always raises TypeError, which tests nothing but the crash
_NON_NUMBER_NODES = (ast.List, ast.ListComp, ast.Dict, ast.Set, ast.Tuple, *FORMATTED_STRING_NODES)


def _rules(expression: Expression, facts: StatementFacts) -> Iterator[MutationRule]:
    node = expression.node
    if isinstance(node, ast.BinOp) and _can_be_number(node.left) and _can_be_number(node.right):
        yield from (mutation_rule("operator_infix", to=to) for to in _REPLACEMENTS_BY_OPERATOR[type(node.op)])
    match node:
        case ast.UnaryOp(op=ast.USub(), operand=operand) if not isinstance(operand, ast.Constant):
            yield mutation_rule("operator_prefix", to="-")
    augmented = facts.augmenting_operator_by_extent.get(extent_of(node))
    if augmented is not None and type(augmented) in _OPERAND_PREFIX_BY_OPERATOR and _can_be_number(node):
        yield mutation_rule("operator_prefix", to=_OPERAND_PREFIX_BY_OPERATOR[type(augmented)])


def _can_be_number(node: ast.expr) -> bool:
    if isinstance(node, ast.Constant):
        return isinstance(node.value, int | float | complex)
    return not isinstance(node, _NON_NUMBER_NODES)


OPERATOR = Operator(
    about="another arithmetic operator",
    replacements=(
        ("`a + b`, `a - b`, `a * b`, `a / b`", "each of the other three"),
        ("`a // b`", "`a / b`, `a * b`"),
        ("`a % b`", "`a // b`, `a * b`"),
        ("`a ** b`", "`a * b`, `a / b`"),
        ("`a @ b`", "`a * b`"),
        (r"`&`, `\|`, `^`", "each of the other two"),
        ("`<<`, `>>`", "the other"),
        ("`-a`", "`-(-a)`"),
        ("`x += b`, `x -= b`", "`b` becomes `-b`"),
        ("`x *= b`, `x /= b`", "`b` becomes `1 / b`"),
    ),
    rules=_rules,
    examples={
        "return a + b": ["a + b -> a - b", "a + b -> a * b", "a + b -> a / b"],
        "return a - b": ["a - b -> a + b", "a - b -> a * b", "a - b -> a / b"],
        "return a // b": ["a // b -> a / b", "a // b -> a * b"],
        "return a % b": ["a % b -> a // b", "a % b -> a * b"],
        "return a ** b": ["a ** b -> a * b", "a ** b -> a / b"],
        "return a << b": ["a << b -> a >> b"],
        "return a & b": ["a & b -> a | b", "a & b -> a ^ b"],
        "return -a": ["-a -> -(-a)"],
        "a += b": ["b -> -b"],
        "a *= b": ["b -> 1 / b"],
        "return 'a' + b": [],
        "return [a] + b": [],
        "a |= b": [],
    },
)
