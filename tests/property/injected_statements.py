"""The injected lines and statements of a mutant, identified by their tags."""

import ast
from collections.abc import Container
from dataclasses import dataclass
from typing import Any

from mutator.mutants.injected_line_syntax import tag_of


@dataclass(frozen=True, slots=True)
class Lines:
    injected: frozenset[int]
    original: tuple[int, ...]

    @classmethod
    def of(cls, mutant: bytes) -> "Lines":
        original, injected = [0], set()
        for number, line in enumerate(mutant.splitlines(keepends=True), 1):
            if tag_of(line):
                injected.add(number)
            original.append(number - len(injected))
        return cls(frozenset(injected), tuple(original))


@dataclass(frozen=True, slots=True)
class Beside:
    """The neighbours of an injected statement: those above and below, the enclosing node, and its position
    there.
    """

    above: Any
    below: Any
    around: Any
    place: int


def take_out(node: ast.AST, injected: Container[int], found: dict[str, Beside]) -> None:
    """Remove injected statements from a tree and record each one's neighbours. A guarded statement stays."""
    for _, body in ast.iter_fields(node):
        if not isinstance(body, list) or not body or not isinstance(body[0], ast.AST):
            continue
        kept: list[Any] = []
        names: list[tuple[str, int]] = []
        for child in body:
            if not isinstance(child, ast.stmt) or child.lineno not in injected:
                kept.append(child)
            elif isinstance(child, ast.If):
                names.append((_id_in(child.test), len(kept)))
                kept += [inner for inner in child.body if inner.lineno not in injected]
        for name, at in names:
            above, below = kept[at - 1] if at else None, kept[at] if at < len(kept) else None
            found[name] = Beside(above, below, node, at)
        body[:] = kept
    for child in ast.iter_child_nodes(node):
        take_out(child, injected, found)


def _id_in(test: ast.expr) -> str:
    call = test.operand if isinstance(test, ast.UnaryOp) else test
    assert isinstance(call, ast.Call) and isinstance(call.args[0], ast.Constant)
    return str(call.args[0].value)
