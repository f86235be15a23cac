"""Reusable changes: a changed file without its inserted lines, which other mutants fill with their lines.

Splicing and compiling a file takes milliseconds, and many mutants insert the same lines except for numbers
and ids. Only the first is spliced. The number of reusable changes depends on the library, not on the number
of mutants.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

from mutator.mutants.anchors import ParsedFile
from mutator.mutants.injected_lines import tag_of
from mutator.mutants.normalized_source import compiles, normalized
from mutator.mutants.splicing import Edit, in_order
from mutator.targets.source_tree import SourceTree

ReuseKey = tuple[tuple[int, int, int, bytes, str], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Change:
    """A changed file: its new content, and the patch that makes it (not UTF-8: surrogate escapes)."""

    data: bytes
    patch: str


@dataclass(frozen=True, slots=True, kw_only=True)
class ReusableChange:
    """A change without its inserted lines: the parts before, between and after them."""

    data: tuple[bytes, ...]
    patch: tuple[str, ...]

    @classmethod
    def of(cls, change: Change) -> "ReusableChange":
        """The change without its tagged lines, which are the inserted ones, since no target has tags."""
        patch = change.patch.encode("utf-8", "surrogateescape")
        return cls(
            data=tuple(_parts(change.data, b"")), patch=tuple(_text(part) for part in _parts(patch, b"+"))
        )

    def filled(self, lines: Sequence[bytes]) -> Change:
        """The change with these lines (without their line ends) inserted."""
        data: list[bytes] = [b""] * (2 * len(lines) + 1)
        patch = [""] * len(data)
        data[::2], data[1::2] = self.data, lines
        patch[::2], patch[1::2] = self.patch, map(_text, lines)
        return Change(data=b"".join(data), patch="".join(patch))


def known_changes(tree: SourceTree, path: str) -> dict[ReuseKey, ReusableChange | Change]:
    """The changes of a file made so far, reusable or single.

    Callers add to this dictionary, which is kept with the tree.
    """
    return tree.derived(path, _none_yet)


def _none_yet(path: str, data: bytes, root: Path) -> dict[ReuseKey, ReusableChange | Change]:
    return {}


def reuse_key(file: ParsedFile, edits: Sequence[Edit], ids: Sequence[str]) -> ReuseKey:
    """What edits of a file must have in common to share a reusable change; `ids` are those in their lines."""
    return tuple(
        (e.index, e.rank, e.reindent, e.unit, normalized(b"".join(e.lines).decode(file.encoding), ids))
        for e in in_order(edits)
    )


def inserted_lines(edits: Sequence[Edit]) -> list[bytes]:
    """The inserted lines from the top of the file to its end, without their line ends."""
    return [line.rstrip(b"\r\n") for line in chain.from_iterable(e.lines for e in in_order(edits))]


def always_compiles(file: ParsedFile, change: ReusableChange, key: ReuseKey) -> bool:
    """Whether the change compiles with all lines of this key, i.e. with normalized ones.

    It then un-splices too, since that depends only on the tags, which are part of the key.
    """
    texts = (text.rstrip("\r\n") for *_, text in key)  # the file's last line may have no end
    lines = "\n".join(texts).encode(file.encoding).splitlines()
    return compiles(change.filled(lines).data)


def _parts(data: bytes, sign: bytes) -> list[bytes]:
    """The parts around the tagged lines, with their `sign` and line ends."""
    parts = [b""]
    for line in data.splitlines(keepends=True):
        if tag_of(line):
            parts[-1] += sign
            parts.append(line[len(line.rstrip(b"\r\n")) :])
        else:
            parts[-1] += line
    return parts


def _text(data: bytes) -> str:
    return data.decode("utf-8", "surrogateescape")
