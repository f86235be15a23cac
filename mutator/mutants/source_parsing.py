"""Parses a source file with both Python and LibCST, and refuses it if they disagree."""

import ast
import re
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import zip_longest
from pathlib import Path

import libcst as cst
from libcst.metadata import MetadataWrapper, PositionProvider

from mutator.errors import MutatorError
from mutator.mutants.injected_lines import find_instrumented_line
from mutator.mutants.positions_of_both_parsers import RangeByNode, line_after_statements

MOST_SYNTAX_NODES = 50_000  # of a file's syntax tree; LibCST takes about 0.1 ms and 4 kB for each
MOST_CHAIN_LINKS = 500  # LibCST recurses once for each link, and thousands would end the process
# `splitlines` ends a line at a lone CR, but `patch` does not
_LONE_CR_PATTERN = re.compile(rb"\r(?!\n)")


def check_line_ends_and_uninstrumented(data: bytes, where: Path) -> None:
    if match := _LONE_CR_PATTERN.search(data):
        raise MutatorError(
            "a line ends in CR alone",
            where=where,
            line=data[: match.start()].count(b"\n") + 1,
            expected="LF or CRLF",
            remedy="convert the file's line ends",
        )
    line = find_instrumented_line(data)
    if line is not None:
        raise MutatorError(
            "the target uses the name `_fi` or a `# fi:` tag",
            where=where,
            line=line + 1,
            expected="a tree without injected lines",
            remedy="point the manifest at the original tree, or rename `_fi` in the target",
        )


def parse_with_python(data: bytes, where: Path) -> ast.Module:
    try:
        compile(data, str(where), "exec", dont_inherit=True)
        tree = ast.parse(data)
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        message, line = (error.msg, error.lineno) if isinstance(error, SyntaxError) else (str(error), None)
        raise MutatorError(
            f"not valid Python: {message or 'nested too deeply'}",
            where=where,
            line=line,
            remedy="correct the target's source, or use the Python that it is written for",
        ) from None
    _check_tree_size(tree, where)
    return tree


def _check_tree_size(tree: ast.Module, where: Path) -> None:
    """Refuse what would take LibCST long, or end the process: it recurses along chains."""
    for node_count, node in enumerate(ast.walk(tree), start=1):
        links = len(node.values) if isinstance(node, ast.BoolOp) else 0
        if isinstance(node, ast.Import | ast.ImportFrom):
            names = [alias.name for alias in node.names] + [getattr(node, "module", None) or ""]
            links = max(name.count(".") for name in names)
        if node_count > MOST_SYNTAX_NODES or links > MOST_CHAIN_LINKS:
            excess = (
                f"`and`, `or` or a dotted name with {links} parts" if links > MOST_CHAIN_LINKS else "its size"
            )
            raise MutatorError(
                f"too large to be changed: {excess}",
                where=where,
                line=getattr(node, "lineno", None) if links > MOST_CHAIN_LINKS else None,
                expected=f"at most {MOST_SYNTAX_NODES:,} nodes in its syntax tree, "
                f"and chains of {MOST_CHAIN_LINKS}",
                remedy="split the file, or inject into another one",
            )


@contextmanager
def translate_libcst_errors(where: Path) -> Iterator[None]:
    """Turn the errors of LibCST on valid Python into MutatorError."""
    try:
        yield
    except (cst.ParserSyntaxError, SyntaxError, UnicodeError, RecursionError) as error:
        message, line = str(error), None
        if isinstance(error, cst.ParserSyntaxError):
            message = error.message.partition(": expected")[0]
            # the tokenizer counts lines from the start of a part of the file
            line = None if message.startswith("tokenizer") else error.raw_line
        raise MutatorError(
            f"LibCST cannot parse this file: {message}",
            where=where,
            line=line,
            expected="Python that LibCST can parse, not nested too deeply",
            remedy="rewrite the code, or inject into another file",
        ) from None


def parse_with_libcst(data: bytes, where: Path) -> tuple[cst.Module, RangeByNode]:
    """Parse the file with LibCST; MutatorError unless LibCST reproduces the file's bytes."""
    module = cst.parse_module(data)
    written = module.bytes
    if written != data:
        pairs = zip_longest(data.splitlines(keepends=True), written.splitlines(keepends=True))
        line = next(
            i for i, (original_line, written_line) in enumerate(pairs) if original_line != written_line
        )
        text = b"".join(data.splitlines()[line : line + 1]).decode(errors="replace").strip()
        raise MutatorError(
            f"LibCST does not reproduce the line `{text}`",
            where=where,
            line=line + 1,
            expected="no line with only a backslash, no form feed before code",
            remedy="rewrite the code, or inject into another file",
        )
    return module, MetadataWrapper(module, unsafe_skip_copy=True).resolve(PositionProvider)


def import_insertion_line(module: cst.Module, positions: RangeByNode) -> int:
    """Return the index of the line before which to insert imports: after docstring and `__future__`."""
    after = None
    for i, node in enumerate(module.body):
        if not isinstance(node, cst.SimpleStatementLine):
            break
        small = node.body[0]
        docstring = (
            i == 0
            and isinstance(small, cst.Expr)
            and isinstance(small.value, cst.SimpleString | cst.ConcatenatedString)
        )
        future = (
            isinstance(small, cst.ImportFrom)
            and isinstance(small.module, cst.Name)
            and small.module.value == "__future__"
        )
        if not (docstring or future):
            break
        after = line_after_statements(node, positions)
    if after is not None:
        return after
    return _first_line_with_decorators(module.body[0], positions) if module.body else len(module.header)


def _first_line_with_decorators(node: cst.CSTNode, positions: RangeByNode) -> int:
    decorators = node.decorators if isinstance(node, cst.FunctionDef | cst.ClassDef) else ()
    return min(positions[n].start.line for n in (node, *decorators)) - 1
