"""Finds expressions whose value can be changed in place, such as returned values and arguments.

Python's parser finds them; LibCST must find an expression in the same place. Expressions are skipped if they
begin or end on a line that cannot end in a tag, because it ends inside a string or in a backslash.
"""

import ast
import io
import tokenize
from codecs import BOM_UTF8
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import libcst as cst

from mutator.model import AnchorKind
from mutator.mutants.expression_roles import (
    AnchorRole,
    ExpressionInFunction,
    expressions_in_functions,
    source_of,
)
from mutator.mutants.positions_of_both_parsers import RangeByNode

# line and column, from 0; in `Expression`, columns count bytes, elsewhere characters
_ZeroBasedPosition = tuple[int, int]

# no operator beside these binds a part of them, so they need no parentheses
_UNSPLITTABLE_NODES = (
    ast.Name | ast.Attribute | ast.Call | ast.Subscript | ast.Constant | ast.List | ast.Dict | ast.Set
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Expression:
    """An expression in a function, from `start` to `end` (exclusive).

    Each of its `roles` is an anchor that matches it: kind, name, `which`. In the last role, the kind is VALUE
    and the name is the expression's text.
    """

    function: str
    start: _ZeroBasedPosition
    end: _ZeroBasedPosition
    roles: tuple[AnchorRole, ...]
    one_line_source: str  # source on one line, in parentheses if an adjacent operator could split it
    is_bare_tuple_or_walrus: (
        bool  # an unparenthesized tuple or a `:=`; parentheses around it are not part of it
    )
    node: ast.expr

    @property
    def anchor_name(self) -> str:
        """The expression's name in anchors, independent of spacing and quotes."""
        return self.roles[-1][1]

    def matches_anchor(self, kind: AnchorKind, name: str, which: str | None) -> bool:
        """Return whether an anchor matches. An empty name matches any name; None as `which`, any position."""
        return any(
            kind is role_kind and name in (role_name, "") and which in (role_which, None)
            for role_kind, role_name, role_which in self.roles
        )


def _grouped_by_function(expressions: Iterable[Expression]) -> dict[str, tuple[Expression, ...]]:
    groups: dict[str, list[Expression]] = defaultdict(list)
    for expression in expressions:
        groups[expression.function].append(expression)
    return {name: tuple(group) for name, group in groups.items()}


def list_expressions(
    data: bytes, tree: ast.Module, module: cst.Module, positions: RangeByNode
) -> dict[str, tuple[Expression, ...]]:
    encoding = module.encoding.removesuffix("-sig")
    lines = [line.decode(encoding) for line in data.removeprefix(BOM_UTF8).splitlines(keepends=True)]
    tokens = list(tokenize.tokenize(io.BytesIO(data).readline))
    libcst_extents, untaggable, brackets = (
        _libcst_extents(positions),
        _untaggable_lines(data, tokens),
        _closing_bracket_ends(tokens),
    )
    expressions = []
    for function, node, roles in expressions_in_functions(tree):
        start, end = _extent_of(lines, node)
        text, is_confirmed = (
            source_of(node),
            all(_extent_of(lines, part) in libcst_extents for part in _nodes_libcst_must_have(node)),
        )
        if text and is_confirmed and untaggable.isdisjoint((start[0], end[0])):
            bare = isinstance(node, ast.NamedExpr) or (
                isinstance(node, ast.Tuple) and brackets.get(start) != end
            )
            roles = (*roles, (AnchorKind.VALUE, text, None))
            expressions.append(
                _build_expression(
                    lines, encoding, (function, node, roles), start, end, is_bare_tuple_or_walrus=bare
                )
            )
    # an outer expression precedes those inside it, so that `nth` counts in reading order
    return _grouped_by_function(
        sorted(
            expressions, key=lambda expression: (expression.start, (-expression.end[0], -expression.end[1]))
        )
    )


def _build_expression(
    lines: Sequence[str],
    encoding: str,
    expression: ExpressionInFunction,
    start: _ZeroBasedPosition,
    end: _ZeroBasedPosition,
    *,
    is_bare_tuple_or_walrus: bool,
) -> Expression:
    function, node, roles = expression
    one_line = start[0] == end[0]
    written = lines[start[0]][start[1] : end[1]] if one_line else roles[-1][1]
    alone = isinstance(node, _UNSPLITTABLE_NODES) or (
        isinstance(node, ast.Tuple | ast.NamedExpr) and not (is_bare_tuple_or_walrus and one_line)
    )
    return Expression(
        function=function,
        start=(start[0], len(lines[start[0]][: start[1]].encode(encoding))),
        end=(end[0], len(lines[end[0]][: end[1]].encode(encoding))),
        roles=roles,
        one_line_source=written if alone else f"({written})",
        is_bare_tuple_or_walrus=is_bare_tuple_or_walrus,
        node=node,
    )


def _extent_of(lines: Sequence[str], node: ast.expr) -> tuple[_ZeroBasedPosition, _ZeroBasedPosition]:
    """Return where a node begins and ends: line and character column, from 0. `ast` counts UTF-8 bytes."""
    assert node.end_lineno is not None and node.end_col_offset is not None

    def point(line: int, column: int) -> _ZeroBasedPosition:
        text = lines[line - 1]
        return line - 1, column if text.isascii() else len(text.encode()[:column].decode())

    return point(node.lineno, node.col_offset), point(node.end_lineno, node.end_col_offset)


def _nodes_libcst_must_have(node: ast.expr) -> Iterator[ast.expr]:
    """Yield the nodes that LibCST must also find: this node or, if it is a tuple, its elements."""
    if isinstance(node, ast.Tuple):
        for element in node.elts:
            yield from _nodes_libcst_must_have(element)
    else:
        yield node


def _libcst_extents(positions: RangeByNode) -> frozenset[tuple[_ZeroBasedPosition, _ZeroBasedPosition]]:
    return frozenset(
        ((span.start.line - 1, span.start.column), (span.end.line - 1, span.end.column))
        for node, span in positions.items()
        if isinstance(node, cst.BaseExpression)
    )


def _closing_bracket_ends(
    tokens: Iterable[tokenize.TokenInfo],
) -> dict[_ZeroBasedPosition, _ZeroBasedPosition]:
    """Map the position of each opening bracket to the end of its closing bracket; lines from 0."""
    ends, starts = {}, list[_ZeroBasedPosition]()
    for token in tokens:
        if token.type == tokenize.OP and token.string in "([{":
            starts.append((token.start[0] - 1, token.start[1]))
        elif token.type == tokenize.OP and token.string in ")]}":
            ends[starts.pop()] = (token.end[0] - 1, token.end[1])
    return ends


def _untaggable_lines(data: bytes, tokens: Iterable[tokenize.TokenInfo]) -> frozenset[int]:
    """Return the lines (from 0) that cannot end in a comment."""
    lines = {i for i, line in enumerate(data.splitlines()) if line.endswith(b"\\")}
    starts: list[int] = []  # first lines of the f-strings and t-strings that are still open
    for token in tokens:
        kind = tokenize.tok_name[token.type]
        if kind in ("FSTRING_START", "TSTRING_START"):
            starts.append(token.start[0])
        is_end = kind in ("FSTRING_END", "TSTRING_END")
        first = starts.pop() if is_end else token.start[0]
        if is_end or kind == "STRING":
            lines.update(range(first - 1, token.end[0] - 1))
    return frozenset(lines)


NO_TEMPLATE_PARTS: dict[str, object] = {"left": None, "right": None, "called": None, "arguments": []}


def template_parts(expression: Expression) -> dict[str, object]:
    """Return the parts of an expression that templates can use, None or empty if missing.

    `left` and `right` are operands, `called` is a call's function.
    """
    node, left, right = expression.node, None, None
    if isinstance(node, ast.BinOp):
        left, right = node.left, node.right
    elif isinstance(node, ast.Compare) and len(node.comparators) == 1:
        left, right = node.left, node.comparators[0]
    elif isinstance(node, ast.BoolOp):
        *before, right = node.values
        left = before[0] if len(before) == 1 else ast.BoolOp(node.op, before)
    called, arguments = None, list[str]()
    if isinstance(node, ast.Call):
        called = _source_parenthesized_if_splittable(node.func)
        arguments = [ast.unparse(argument) for argument in (*node.args, *node.keywords)]
    sides = [side and _source_parenthesized_if_splittable(side) for side in (left, right)]
    return {"left": sides[0], "right": sides[1], "called": called, "arguments": arguments}


def parenthesized_if_splittable(text: str) -> str:
    """Return the source of an expression, in parentheses if an adjacent operator could split it."""
    return text if isinstance(ast.parse(text, mode="eval").body, _UNSPLITTABLE_NODES) else f"({text})"


def _source_parenthesized_if_splittable(node: ast.expr) -> str:
    text = ast.unparse(node)
    return text if isinstance(node, _UNSPLITTABLE_NODES) else f"({text})"
