"""The text of an anchored statement and of the next one, for fault models that repeat or reorder them."""

import ast
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import lru_cache

from mutator.errors import MutatorError
from mutator.faults.fault_models import TemplateNeed
from mutator.mutants.expression_roles import FORMATTED_STRING_NODES
from mutator.mutants.parsed_files_and_anchors import ParsedFile, ResolvedAnchor

# statements without a block: only these can be repeated or moved as one line
_SMALL_STATEMENTS = (
    ast.Assign | ast.AugAssign | ast.AnnAssign | ast.Expr | ast.Return | ast.Delete | ast.Raise | ast.Assert
)
_SMALL_STATEMENTS |= ast.Pass | ast.Break | ast.Continue
# repeated or swapped, these would leave code that never runs
_BLOCK_ENDING_STATEMENTS = ast.Return | ast.Raise | ast.Break | ast.Continue
_BLOCK_FIELDS = ("body", "orelse", "finalbody")


def anchor_and_one_line_texts(
    file: ParsedFile, anchor: ResolvedAnchor, needs: TemplateNeed
) -> tuple[ResolvedAnchor, dict[str, str]]:
    """Return the anchor, and the text of each statement on one line, by its name in templates.

    If the model needs the next statement, the anchor covers both. MutatorError if there is no such statement,
    or if its lines cannot be moved.
    """
    anchored, following = _small_statements_by_line(file.target_data).get(anchor.first_line, (None, None))
    if anchored is None or anchor.first_line == anchor.end_line or not anchor.is_alone_on_line:
        raise _unfit_error(file, anchor, "the anchor is not at a statement that is alone on its lines")
    if isinstance(anchored, _BLOCK_ENDING_STATEMENTS):
        raise _unfit_error(file, anchor, f"`{ast.unparse(anchored)}` ends its block")
    texts = {"statement": _one_line_text(file, anchor, anchored)}
    if needs is TemplateNeed.NEXT_STATEMENT:
        if following is None:
            raise _unfit_error(
                file, anchor, "the next statement is missing, shares its lines, or opens a block"
            )
        texts["next_statement"] = _one_line_text(file, anchor, following)
        anchor = _extend_to_next_statement(file, anchor, following)
    return anchor, texts


def _extend_to_next_statement(
    file: ParsedFile, anchor: ResolvedAnchor, following: ast.stmt
) -> ResolvedAnchor:
    last = following.end_lineno or 0
    if anchor.indentable_line_count != anchor.end_line - anchor.first_line or _has_multiline_string(
        following
    ):
        raise _unfit_error(file, anchor, "a string spans several lines, so its statement cannot be indented")
    return replace(anchor, end_line=last, indentable_line_count=last - anchor.first_line)


def _has_multiline_string(statement: ast.stmt) -> bool:
    return any(
        isinstance(node, ast.expr)
        and isinstance(node, (*FORMATTED_STRING_NODES, ast.Constant))
        and node.lineno != node.end_lineno
        for node in ast.walk(statement)
    )


def _one_line_text(file: ParsedFile, anchor: ResolvedAnchor, statement: ast.stmt) -> str:
    text = ast.unparse(statement)
    if "\n" in text:
        raise _unfit_error(file, anchor, "the statement cannot be written on one line")
    if any(isinstance(node, ast.Yield | ast.YieldFrom) for node in ast.walk(statement)):
        raise _unfit_error(
            file, anchor, "the statement contains `yield`, which can be neither repeated nor moved"
        )
    return text


def _unfit_error(file: ParsedFile, anchor: ResolvedAnchor, problem: str) -> MutatorError:
    return MutatorError(
        problem,
        where=file.full_path,
        line=anchor.first_line + 1,
        expected="an anchor before or after a call, an assignment or a return that is alone on its lines",
        remedy="anchor at another statement",
    )


@lru_cache(maxsize=32)
def _small_statements_by_line(data: bytes) -> Mapping[int, tuple[ast.stmt, ast.stmt | None]]:
    """Map line numbers (from 0) to the small statement that begins there and the next one in its block.

    The next one is None if it is missing or shares its lines with another.
    """
    return {
        statement.lineno - 1: (statement, following if _can_be_moved(statement, following, beyond) else None)
        for block in _blocks_in(ast.parse(data))
        for statement, following, beyond in zip(
            block, [*block[1:], None], [*block[2:], None, None], strict=False
        )
        if isinstance(statement, _SMALL_STATEMENTS)
    }


def _can_be_moved(statement: ast.stmt, following: ast.stmt | None, beyond: ast.stmt | None) -> bool:
    if not isinstance(following, _SMALL_STATEMENTS) or following.lineno <= (statement.end_lineno or 0):
        return False
    return beyond is None or beyond.lineno > (following.end_lineno or 0)


def _blocks_in(tree: ast.Module) -> Iterator[list[ast.stmt]]:
    for node in ast.walk(tree):
        for name in _BLOCK_FIELDS:
            block = getattr(node, name, None)
            if isinstance(block, list):
                yield block
