"""Compiles functions alone, to check a change without compiling its file."""

import ast
from collections.abc import Iterator, Sequence
from types import CodeType


def list_outermost_function_lines(tree: ast.AST) -> Iterator[range]:
    """Yield the lines (from 0) of each outermost function, including decorators."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            first = min(part.lineno for part in (node, *node.decorator_list)) - 1
            yield range(first, node.end_lineno or node.lineno)
        elif not isinstance(node, ast.expr):
            yield from list_outermost_function_lines(node)


def compile_standalone(lines: Sequence[bytes], encoding: str) -> CodeType | None:
    """Return the code of a module that contains only these lines, or None if they do not compile.

    An outermost function compiles alone if and only if it compiles in its file.
    """
    text = b"".join(lines).decode(encoding).removeprefix("\ufeff")  # a byte order mark
    indented = text[:1] in (" ", "\t", "\f")
    try:
        return compile(f"if 1:\n{text}" if indented else text, "<function>", "exec", dont_inherit=True)
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return None
