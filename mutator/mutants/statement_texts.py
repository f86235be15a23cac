"""The text of an anchored statement and of the next one, for fault models that repeat or reorder them."""

import ast
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import lru_cache

from mutator.errors import MutatorError
from mutator.faults.fault_models import Needs
from mutator.mutants.anchors import ParsedFile, Site

_SMALL = (
    ast.Assign | ast.AugAssign | ast.AnnAssign | ast.Expr | ast.Return | ast.Delete | ast.Raise | ast.Assert
)
_SMALL |= ast.Pass | ast.Break | ast.Continue
_LAST = ast.Return | ast.Raise | ast.Break | ast.Continue
_BLOCKS = ("body", "orelse", "finalbody")


def written_out(file: ParsedFile, site: Site, needs: Needs) -> tuple[Site, dict[str, str]]:
    """Return the site, and the text of each statement on one line, by its name in templates.

    If the model needs the next statement, the site covers both. MutatorError if there is no such statement,
    or if its lines cannot be moved.
    """
    anchored, following = _small_statements(file.data).get(site.first, (None, None))
    if anchored is None or site.first == site.last or not site.alone:
        raise _unfit(file, site, "the anchor is not at a statement that is alone on its lines")
    if isinstance(anchored, _LAST):
        raise _unfit(file, site, f"`{ast.unparse(anchored)}` ends its block")
    texts = {"statement": _one_line(file, site, anchored)}
    if needs is Needs.NEXT_STATEMENT:
        if following is None:
            raise _unfit(file, site, "the next statement is missing, shares its lines, or opens a block")
        texts["next_statement"] = _one_line(file, site, following)
        site = _with_both(file, site, following)
    return site, texts


def _with_both(file: ParsedFile, site: Site, following: ast.stmt) -> Site:
    last = following.end_lineno or 0
    if site.reindent != site.last - site.first or _has_long_string(following):
        raise _unfit(file, site, "a string spans several lines, so its statement cannot be indented")
    return replace(site, last=last, reindent=last - site.first)


def _has_long_string(statement: ast.stmt) -> bool:
    return any(
        isinstance(node, ast.JoinedStr | ast.Constant) and node.lineno != node.end_lineno
        for node in ast.walk(statement)
    )


def _one_line(file: ParsedFile, site: Site, statement: ast.stmt) -> str:
    text = ast.unparse(statement)
    if "\n" in text:
        raise _unfit(file, site, "the statement cannot be written on one line")
    if any(isinstance(node, ast.Yield | ast.YieldFrom) for node in ast.walk(statement)):
        raise _unfit(file, site, "the statement contains `yield`, which can be neither repeated nor moved")
    return text


def _unfit(file: ParsedFile, site: Site, what: str) -> MutatorError:
    return MutatorError(
        what,
        where=file.where,
        line=site.first + 1,
        expected="an anchor before or after a call, an assignment or a return that is alone on its lines",
        remedy="anchor at another statement",
    )


@lru_cache(maxsize=32)
def _small_statements(data: bytes) -> Mapping[int, tuple[ast.stmt, ast.stmt | None]]:
    """Map line numbers (from 0) to the small statement that begins there and the next one in its block.

    The next one is None if it is missing or shares its lines with another.
    """
    return {
        statement.lineno - 1: (statement, following if _is_fit(statement, following, beyond) else None)
        for block in _blocks(ast.parse(data))
        for statement, following, beyond in zip(
            block, [*block[1:], None], [*block[2:], None, None], strict=False
        )
        if isinstance(statement, _SMALL)
    }


def _is_fit(statement: ast.stmt, following: ast.stmt | None, beyond: ast.stmt | None) -> bool:
    if not isinstance(following, _SMALL) or following.lineno <= (statement.end_lineno or 0):
        return False
    return beyond is None or beyond.lineno > (following.end_lineno or 0)


def _blocks(tree: ast.Module) -> Iterator[list[ast.stmt]]:
    for node in ast.walk(tree):
        for name in _BLOCKS:
            block = getattr(node, name, None)
            if isinstance(block, list):
                yield block
