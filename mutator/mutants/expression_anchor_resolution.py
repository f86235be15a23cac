"""Resolves an anchor to the one expression that it names."""

import ast
from collections.abc import Sequence
from difflib import get_close_matches
from pathlib import Path

from mutator._common.message_text import counted
from mutator.errors import MutatorError
from mutator.model import Anchor, AnchorKind, FaultLocation
from mutator.mutants.changeable_expressions import Expression

_MOST_CANDIDATES = 12  # candidates listed in an error


def normalized_anchor_name(name: str) -> str:
    """Return the normalized text by which anchors are compared; invalid text is unchanged."""
    try:
        return ast.unparse(ast.parse(name.strip(), mode="eval"))
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return name


def describe_valid_nth(count: int) -> str:
    """Return which values of `nth` select one of `count` hits."""
    return f"a number from 1 to {count}" if count > 1 else "1, or leave it out"


def choose_expression(
    expressions: Sequence[Expression], location: FaultLocation, where: Path, function_line: int
) -> Expression:
    """Choose from a function's expressions the one that the location's anchor names.

    The function begins at `function_line`, counted from 0. MutatorError with candidates unless exactly one
    matches.
    """
    anchor, kind = location.anchor, location.anchor.kind
    name = normalized_anchor_name(anchor.name)
    matches = [
        expression for expression in expressions if expression.matches_anchor(kind, name, anchor.which)
    ]
    nth = anchor.nth
    if matches and (len(matches) == 1 if nth is None else nth <= len(matches)):
        return matches[(nth or 1) - 1]
    what = " ".join(
        filter(None, (f"`{kind.value}: {anchor.name}`".replace(": `", "`"), _describe_which(anchor)))
    )
    if matches:
        lines = ", ".join(str(expression.start[0] + 1) for expression in matches)
        nth_range = describe_valid_nth(len(matches))
        raise MutatorError(
            f"{what} names {counted(len(matches), 'expression')} in {location.function}: "
            f"{'lines' if len(matches) > 1 else 'line'} {lines}",
            where=where,
            line=matches[0].start[0] + 1,
            expected="exactly one",
            remedy=f"give `nth`, {nth_range}" if nth is None else f"`nth` is {nth}: give {nth_range}",
        )
    raise MutatorError(
        f"no {what} in {location.function}",
        where=where,
        line=function_line + 1,
        expected=_describe_candidates(expressions, kind, name),
        remedy="write the expression exactly as in the source",
    )


def _describe_which(anchor: Anchor) -> str:
    return f"with `which: {anchor.which}`" if anchor.which else ""


def _describe_candidates(expressions: Sequence[Expression], kind: AnchorKind, name: str) -> str:
    """List the anchors of this kind that have this name or, if none has, the most similar names."""
    roles = [
        (called, which, expression)
        for expression in expressions
        for role_kind, called, which in expression.roles
        if role_kind is kind
    ]
    roles = [role for role in roles if role[0] == name] or roles
    if len(roles) > _MOST_CANDIDATES:
        # a cutoff of 0 only ranks: the error must list something, however different the names
        near = get_close_matches(name, [called for called, *_ in roles], n=_MOST_CANDIDATES, cutoff=0.0)
        roles = [role for role in roles if role[0] in near][:_MOST_CANDIDATES]
    descriptions = [
        f"`{called}`" + (f" with `which: {place}`" if place else "") + f" (line {expression.start[0] + 1})"
        for called, place, expression in roles
    ]
    return (
        f"one of {', '.join(descriptions)}"
        if descriptions
        else "another kind of anchor: there is none of this kind"
    )
