"""What a decision is bound to, as text and digests: diff, target functions, templates, called code."""

import ast
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

from mutator._common.hashing import content_id
from mutator.model import FaultLocation
from mutator.mutants.injected_line_syntax import adds_fault
from mutator.mutants.patches_by_file import adds_file, split_into_file_patches
from mutator.review.patch_shapes import HOLE_CHARACTER, without_values
from mutator.review.review_entries import BasisDigests
from mutator.targets.source_tree import SourceTree

# line numbers, which change when somebody edits lines above
_HUNK_HEAD_PATTERN = re.compile(r"^@@ .*$", re.MULTILINE)
_SHOWN_HOLE = "⟨⟩"


@dataclass(frozen=True, slots=True, kw_only=True)
class BasisTexts:
    """The texts that a decision is bound to. `diff` has one text for each shape, or a pair of texts for each
    change that an operator makes.
    """

    diff: Sequence[str] | Sequence[Sequence[str]]
    functions: Mapping[str, str]
    templates: Mapping[str, str | Sequence[str]]
    called_code: Mapping[str, str]

    @property
    def digests(self) -> BasisDigests:
        return BasisDigests(
            diff=content_id(self.diff),
            function=content_id(self.functions),
            template=content_id(self.templates),
            calls=content_id(self.called_code),
        )

    @property
    def sections(self) -> dict[str, str]:
        changes = (change if isinstance(change, str) else " -> ".join(change) + "\n" for change in self.diff)
        return {
            "diff": "".join(changes).replace(HOLE_CHARACTER, _SHOWN_HOLE),
            "function": _join_titled(self.functions),
            "template": _join_titled(self.templates),
            "calls": _join_titled(self.called_code),
        }


def distinct_diffs(patches: Iterable[str]) -> list[str]:
    """Distinct patches without values and line numbers, in an order that does not depend on values."""
    texts = sorted({without_values(patch) for patch in patches})
    return list(dict.fromkeys(_HUNK_HEAD_PATTERN.sub("@@", text) for text in texts))


def function_sources(tree: SourceTree, locations: Iterable[FaultLocation]) -> dict[str, str]:
    return {
        f"{location.path} {location.function}": _function_source(
            tree.files[location.path], location.function
        ).decode("utf-8", "surrogateescape")
        for location in locations
        if location.path in tree.files  # a defence is in defended trees only
    }


def fault_hunks(patch: str) -> str:
    """Return the hunks of a patch that contain lines of a fault."""
    pieces = []
    for section in split_into_file_patches(patch):
        if not adds_file(section):
            head, *hunks = re.split(r"^(?=@@ )", section, flags=re.MULTILINE)
            fault_hunks_only = [hunk for hunk in hunks if adds_fault(hunk)]
            pieces += [head, *fault_hunks_only] if fault_hunks_only else []
    return "".join(pieces)


def _join_titled(texts: Mapping[str, str | Sequence[str]]) -> str:
    each = ((name, text if isinstance(text, str) else "\n".join(text)) for name, text in texts.items())
    return "\n".join(f"-- {name}\n{text.rstrip()}\n" for name, text in each)


@lru_cache(maxsize=256)
def _function_source(data: bytes, name: str) -> bytes:
    """Return the source of the functions with this qualified name, decorators included."""
    lines = data.splitlines(keepends=True)
    spans = [
        (min(n.lineno for n in (node, *node.decorator_list)), node.end_lineno)
        for path, node in _walk_functions(ast.parse(data), ())
        if path == name
    ]
    return b"".join(b"".join(lines[first - 1 : last]) for first, last in spans)


def _walk_functions(
    tree: ast.AST, path: tuple[str, ...]
) -> Iterator[tuple[str, ast.FunctionDef | ast.AsyncFunctionDef]]:
    for node in ast.iter_child_nodes(tree):
        inside = path
        if isinstance(node, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            inside = (*path, node.name)
            if not isinstance(node, ast.ClassDef):
                yield ".".join(inside), node
        yield from _walk_functions(node, inside)
