"""What a decision is bound to, as text and digests: diff, target functions, templates, called code."""

import ast
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

from mutator._common.hashing import content_id
from mutator.model import FaultLocation
from mutator.mutants.injected_lines import adds_fault
from mutator.mutants.readable_patches import adds_file, file_patches
from mutator.review.entries import Bound
from mutator.review.patch_shapes import HOLE, without_values
from mutator.targets.source_tree import SourceTree

_HUNK_HEAD = re.compile(r"^@@ .*$", re.MULTILINE)
_SHOWN_HOLE = "⟨⟩"


@dataclass(frozen=True, slots=True, kw_only=True)
class Material:
    """The texts that a decision is bound to. `diff` has one text for each shape, or a pair of texts for each
    change that an operator makes.
    """

    diff: Sequence[str] | Sequence[Sequence[str]]
    functions: Mapping[str, str]
    templates: Mapping[str, str | Sequence[str]]
    calls: Mapping[str, str]

    @property
    def bound(self) -> Bound:
        return Bound(
            diff=content_id(self.diff),
            function=content_id(self.functions),
            template=content_id(self.templates),
            calls=content_id(self.calls),
        )

    @property
    def sections(self) -> dict[str, str]:
        changes = (one if isinstance(one, str) else " -> ".join(one) + "\n" for one in self.diff)
        return {
            "diff": "".join(changes).replace(HOLE, _SHOWN_HOLE),
            "function": _named(self.functions),
            "template": _named(self.templates),
            "calls": _named(self.calls),
        }


def diffs_of(patches: Iterable[str]) -> list[str]:
    """Distinct patches without values and line numbers, in an order that does not depend on values."""
    texts = sorted({without_values(patch) for patch in patches})
    return list(dict.fromkeys(_HUNK_HEAD.sub("@@", text) for text in texts))


def functions_of(tree: SourceTree, locations: Iterable[FaultLocation]) -> dict[str, str]:
    return {
        f"{place.path} {place.function}": _function(tree.files[place.path], place.function).decode(
            "utf-8", "surrogateescape"
        )
        for place in locations
    }


def fault_hunks(patch: str) -> str:
    """Return the hunks of a patch that contain lines of a fault."""
    kept = []
    for section in file_patches(patch):
        if not adds_file(section):
            head, *hunks = re.split(r"^(?=@@ )", section, flags=re.MULTILINE)
            own = [hunk for hunk in hunks if adds_fault(hunk)]
            kept += [head, *own] if own else []
    return "".join(kept)


def _named(texts: Mapping[str, str | Sequence[str]]) -> str:
    each = ((name, text if isinstance(text, str) else "\n".join(text)) for name, text in texts.items())
    return "\n".join(f"-- {name}\n{text.rstrip()}\n" for name, text in each)


@lru_cache(maxsize=256)
def _function(data: bytes, name: str) -> bytes:
    """Return the source of the functions with this qualified name, decorators included."""
    lines = data.splitlines(keepends=True)
    spans = [
        (min(n.lineno for n in (node, *node.decorator_list)), node.end_lineno)
        for path, node in _functions(ast.parse(data), ())
        if path == name
    ]
    return b"".join(b"".join(lines[first - 1 : last]) for first, last in spans)


def _functions(
    tree: ast.AST, path: tuple[str, ...]
) -> Iterator[tuple[str, ast.FunctionDef | ast.AsyncFunctionDef]]:
    for node in ast.iter_child_nodes(tree):
        inside = path
        if isinstance(node, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            inside = (*path, node.name)
            if not isinstance(node, ast.ClassDef):
                yield ".".join(inside), node
        yield from _functions(node, inside)
