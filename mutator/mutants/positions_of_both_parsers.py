"""Finds the positions of functions and statements according to LibCST and `ast`, to compare them.

If a parser drops a line, all positions below it shift. A mutant made with such positions would compile and
un-splice, but its fault would be on the wrong line.
"""

import ast
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import libcst as cst
from libcst.metadata import CodePosition, CodeRange

RangeByNode = Mapping[cst.CSTNode, CodeRange]
_LineColumn = tuple[int, int]
# only these assign, call or return as a whole
_ANCHORABLE_STATEMENTS = ast.Assign | ast.AugAssign | ast.AnnAssign | ast.Expr | ast.Return


@dataclass(frozen=True, slots=True, kw_only=True)
class NodePosition:
    """The position of a function or a small statement: line (from 1) and column.

    LibCST counts columns in characters, `ast` in bytes of UTF-8.
    """

    node_class: str  # the node's class in `ast`
    start: _LineColumn
    end: _LineColumn  # end of a statement; start of a function's first statement, including a docstring
    has_docstring: bool = False

    def with_byte_columns(self, lines: Sequence[bytes], encoding: str) -> "NodePosition":
        """Convert the columns to bytes of UTF-8; `lines` are the lines of the file."""

        def column(point: _LineColumn) -> _LineColumn:
            line, characters = point
            text = lines[line - 1].decode(encoding, "replace")
            return line, len(text[:characters].encode("utf-8", "replace"))

        return replace(self, start=column(self.start), end=column(self.end))


def function_position(node: cst.FunctionDef, positions: RangeByNode) -> NodePosition:
    first: cst.CSTNode = node.body.body[0]
    if isinstance(first, cst.SimpleStatementLine):
        first = first.body[0]
    return NodePosition(
        node_class="AsyncFunctionDef" if node.asynchronous else "FunctionDef",
        start=_line_and_column(positions[node].start),
        end=_line_and_column(positions[first].start),
        has_docstring=node.get_docstring(clean=False) is not None,
    )


def statement_position(node: cst.BaseSmallStatement, positions: RangeByNode) -> NodePosition:
    span = positions[node]
    return NodePosition(
        node_class=type(node).__name__, start=_line_and_column(span.start), end=_line_and_column(span.end)
    )


def line_after_statements(
    node: cst.SimpleStatementLine | cst.SimpleStatementSuite, positions: RangeByNode
) -> int:
    """Return the index of the first line after a line of statements, including backslash continuations."""
    space = node.trailing_whitespace.whitespace.value
    semicolon = node.body[-1].semicolon
    if isinstance(semicolon, cst.Semicolon):
        space += cst.Module([]).code_for_node(semicolon)
    return positions[node].end.line + space.count("\\")


def _line_and_column(position: CodePosition) -> _LineColumn:
    return position.line, position.column


def ast_node_positions(tree: ast.Module) -> frozenset[NodePosition]:
    """Return the positions of functions and anchorable statements, with columns in bytes of UTF-8."""
    positions = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            first, text = node.body[0], ast.get_docstring(node, clean=False)
            to, docstring = (first.lineno, first.col_offset), text is not None
        elif isinstance(node, _ANCHORABLE_STATEMENTS):
            to, docstring = (node.end_lineno or 0, node.end_col_offset or 0), False
        else:
            continue
        start = (node.lineno, node.col_offset)
        positions.add(
            NodePosition(node_class=type(node).__name__, start=start, end=to, has_docstring=docstring)
        )
    return frozenset(positions)
