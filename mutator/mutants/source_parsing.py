"""Parses a source file with both Python and LibCST, and refuses it if they disagree.

LibCST need not reproduce the file: mutants are made by inserting lines.
"""

import ast
import io
import keyword
import re
import tokenize
from codecs import BOM_UTF8
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import zip_longest
from pathlib import Path

import libcst as cst
from libcst.metadata import MetadataWrapper, PositionProvider

from mutator.config.location_syntax import PROBE_MODULE_NAME
from mutator.errors import MutatorError
from mutator.mutants.injected_line_syntax import find_tagged_line
from mutator.mutants.libcst_position_realignment import align_positions
from mutator.mutants.logical_lines import LogicalLines
from mutator.mutants.positions_of_both_parsers import RangeByNode, line_after_statements

MOST_SYNTAX_NODES = 50_000  # of a file's syntax tree; LibCST takes about 0.1 ms and 4 kB for each
MOST_CHAIN_LINKS = 500  # LibCST recurses once for each link, and thousands would end the process
# `splitlines` ends a line at a lone CR, but `patch` does not
_LIBCST_PLACE_PATTERN = re.compile(r"error at (\d+):\d+")
_LONE_CR_PATTERN = re.compile(rb"\r(?!\n)")


def check_line_ends_and_tags(data: bytes, where: Path) -> None:
    if match := _LONE_CR_PATTERN.search(data):
        raise MutatorError(
            "a line ends in CR alone",
            where=where,
            line=data[: match.start()].count(b"\n") + 1,
            expected="LF or CRLF",
            remedy="convert the file's line ends",
        )
    line = find_tagged_line(data)
    if line is not None:
        raise MutatorError(
            "the line ends in a `# fi:` tag, as injected lines do",
            where=where,
            line=line + 1,
            expected="a tree without injected lines",
            remedy="point the manifest at the original tree, or change the text",
        )


def _check_probe_name_is_free(tree: ast.Module, where: Path) -> None:
    """Refuse a file that has a variable with the probe's name. Attributes of that name are no variables."""
    for node in ast.walk(tree):
        if PROBE_MODULE_NAME in _variables_in(node):
            raise MutatorError(
                f"the target uses the name `{PROBE_MODULE_NAME}`",
                where=where,
                line=getattr(node, "lineno", None),
                expected="no variable of this name, because injected lines use it",
                remedy="point the manifest at the original tree, or rename the variable",
            )


def _variables_in(node: ast.AST) -> Sequence[str | None]:
    """Return the names that a node itself reads or binds, spelled as the compiler does."""
    match node:
        case ast.Name(id=name) | ast.arg(arg=name) | ast.MatchMapping(rest=name):
            return [name]
        case (
            ast.FunctionDef(name=name)
            | ast.AsyncFunctionDef(name=name)
            | ast.ClassDef(name=name)
            | ast.ExceptHandler(name=name)
            | ast.MatchAs(name=name)
            | ast.MatchStar(name=name)
        ):
            return [name]
        case ast.Global(names=names) | ast.Nonlocal(names=names):
            return names
        case ast.Import(names=aliases) | ast.ImportFrom(names=aliases):
            return [alias.asname or alias.name.partition(".")[0] for alias in aliases]
    return ()


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
    _check_probe_name_is_free(tree, where)
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
            place = _LIBCST_PLACE_PATTERN.search(message)
            line = int(place[1]) if place and not message.startswith("tokenizer") else None
        raise _libcst_error(message, where, line) from None


def _libcst_error(reason: str, where: Path, line: int | None) -> MutatorError:
    return MutatorError(
        f"LibCST cannot parse this file: {reason}",
        where=where,
        line=line,
        expected="Python that LibCST can parse, not nested too deeply",
        remedy="rewrite the code, or inject into another file",
    )


def parse_with_libcst(data: bytes, where: Path) -> tuple[cst.Module, RangeByNode]:
    """Parse the file with LibCST, and return where its nodes are in the file.

    MutatorError if LibCST cannot parse it, or reads something else than Python does.
    """
    try:
        module = cst.parse_module(data)
    except TypeError as error:
        raise _lambda_after_keyword_error(data, where) or _libcst_error(f"{error}", where, None) from None
    positions = MetadataWrapper(module, unsafe_skip_copy=True).resolve(PositionProvider)
    written = module.bytes
    if written == data:
        return module, positions
    encoding = module.encoding.removesuffix("-sig")
    texts = [text.removeprefix(BOM_UTF8).decode(encoding) for text in (written, data)]
    positions_in_file = align_positions(positions, *texts)
    if positions_in_file is None or ast.dump(ast.parse(written)) != ast.dump(ast.parse(data)):
        raise _changed_line_error(data, written, where)
    return module, positions_in_file


def _lambda_after_keyword_error(data: bytes, where: Path) -> MutatorError | None:
    """Return the error about a `lambda` right after a keyword, if that is what LibCST cannot parse."""
    lines = data.decode(tokenize.detect_encoding(io.BytesIO(data).readline)[0]).splitlines(keepends=True)
    brackets = _brackets_between_keyword_and_lambda(data)
    for line, column in reversed(brackets):
        lines[line - 1] = f"{lines[line - 1][:column]} {lines[line - 1][column:]}"
    try:
        cst.parse_module("".join(lines))
    except Exception:
        return None
    if not brackets:
        return None
    return MutatorError(
        "LibCST cannot parse a `lambda` in parentheses right after a keyword",
        where=where,
        line=brackets[0][0],
        expected="a blank between keyword and parenthesis",
        remedy="insert it, or inject into another file",
    )


def _brackets_between_keyword_and_lambda(data: bytes) -> list[tuple[int, int]]:
    """Return line (from 1) and column of each `(` right after a keyword with only `(` before a `lambda`."""
    tokens = list(tokenize.tokenize(io.BytesIO(data).readline))
    brackets = []
    for i, token in enumerate(tokens):
        if token.type == tokenize.NAME and token.string == "lambda":
            while tokens[i - 1].string == "(":
                i -= 1
            before = tokens[i - 1]
            if tokens[i] is not token and keyword.iskeyword(before.string) and before.end == tokens[i].start:
                brackets.append(tokens[i].start)
    return brackets


def _changed_line_error(data: bytes, written: bytes, where: Path) -> MutatorError:
    pairs = zip_longest(data.splitlines(keepends=True), written.splitlines(keepends=True))
    line = next(i for i, (original_line, written_line) in enumerate(pairs) if original_line != written_line)
    text = b"".join(data.splitlines()[line : line + 1]).decode(errors="replace").strip()
    return MutatorError(
        f"LibCST reads the line `{text}` in another way than Python",
        where=where,
        line=line + 1,
        expected="a line that both read in the same way",
        remedy="rewrite the code, or inject into another file",
    )


def import_insertion_line(module: cst.Module, positions: RangeByNode, logical_lines: LogicalLines) -> int:
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
    if not module.body:
        return len(module.header)
    return logical_lines.start_of(_first_line_with_decorators(module.body[0], positions))


def _first_line_with_decorators(node: cst.CSTNode, positions: RangeByNode) -> int:
    decorators = node.decorators if isinstance(node, cst.FunctionDef | cst.ClassDef) else ()
    return min(positions[n].start.line for n in (node, *decorators)) - 1
