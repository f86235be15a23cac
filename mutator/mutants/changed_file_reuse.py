"""Reuses a changed file for all mutants whose inserted lines differ only in numbers and ids.

Only the first of these mutants is spliced and compiled. For the others, its inserted lines are replaced.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

from mutator.mutants.injected_line_syntax import tag_of
from mutator.mutants.normalized_source import normalize_numbers_and_ids, normalized_source_compiles
from mutator.mutants.parsed_files_and_anchors import ParsedFile
from mutator.mutants.splicing import LineEdit, sort_edits
from mutator.targets.source_tree import SourceTree

ReuseKey = tuple[tuple[int, int, int, bytes, str], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class ChangedFile:
    """A changed file. In the patch, bytes that are not UTF-8 become surrogate escapes."""

    data: bytes
    patch: str


@dataclass(frozen=True, slots=True, kw_only=True)
class ReusableChangedFile:
    """The parts of a change before, between and after its inserted lines."""

    data_parts: tuple[bytes, ...]
    patch_parts: tuple[str, ...]

    @classmethod
    def from_changed_file(cls, change: ChangedFile) -> "ReusableChangedFile":
        """Remove the tagged lines from a change."""
        patch = change.patch.encode("utf-8", "surrogateescape")
        return cls(
            data_parts=tuple(_split_at_tagged_lines(change.data, b"")),
            patch_parts=tuple(_decode_patch(part) for part in _split_at_tagged_lines(patch, b"+")),
        )

    def with_inserted_lines(self, lines: Sequence[bytes]) -> ChangedFile:
        """Insert these lines, given without their line ends."""
        data: list[bytes] = [b""] * (2 * len(lines) + 1)
        patch = [""] * len(data)
        data[::2], data[1::2] = self.data_parts, lines
        patch[::2], patch[1::2] = self.patch_parts, map(_decode_patch, lines)
        return ChangedFile(data=b"".join(data), patch="".join(patch))


def reuse_cache(tree: SourceTree, path: str) -> dict[ReuseKey, ReusableChangedFile | ChangedFile]:
    """Return the changes of this file that are already known. Callers add new ones to the dictionary."""
    return tree.derive_once(path, _empty_cache)


def _empty_cache(path: str, data: bytes, root: Path) -> dict[ReuseKey, ReusableChangedFile | ChangedFile]:
    return {}


def reuse_key(file: ParsedFile, edits: Sequence[LineEdit], injection_ids: Sequence[str]) -> ReuseKey:
    """Return what edits must have in common to share a reusable change; `ids` are the ids in their lines."""
    return tuple(
        (
            e.line_index,
            e.rank,
            e.indented_line_count,
            e.indent_unit,
            normalize_numbers_and_ids(b"".join(e.lines).decode(file.encoding), injection_ids),
        )
        for e in sort_edits(edits)
    )


def inserted_lines(edits: Sequence[LineEdit]) -> list[bytes]:
    return [line.rstrip(b"\r\n") for line in chain.from_iterable(e.lines for e in sort_edits(edits))]


def compiles_for_every_mutant(file: ParsedFile, change: ReusableChangedFile, key: ReuseKey) -> bool:
    """Return whether the change compiles with normalized lines, and so for every mutant with this key.

    Un-splicing needs no check: it depends only on the tags, which are part of the key.
    """
    texts = (text.rstrip("\r\n") for *_, text in key)  # the file's last line can lack a line end
    lines = "\n".join(texts).encode(file.encoding).splitlines()
    return normalized_source_compiles(change.with_inserted_lines(lines).data)


def _split_at_tagged_lines(data: bytes, sign: bytes) -> list[bytes]:
    parts = [b""]
    for line in data.splitlines(keepends=True):
        if tag_of(line):
            parts[-1] += sign
            parts.append(line[len(line.rstrip(b"\r\n")) :])
        else:
            parts[-1] += line
    return parts


def _decode_patch(data: bytes) -> str:
    return data.decode("utf-8", "surrogateescape")
