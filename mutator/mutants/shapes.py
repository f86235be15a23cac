"""Molds: what the splicer once made of a file, cut where the inserted lines stand, to be filled with others.

Splicing, comparing and compiling a file of some hundred lines takes milliseconds, and the mutants of a
campaign differ in few things: edits of one *shape* stand at the same lines and have the same skeleton. The
first of a shape is made the direct way; the others are its mold with their own lines, byte for byte what the
direct way would give. How many molds there are depends on the library, not on how many mutants are made.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain

from mutator.mutants.anchors import TAG, ParsedFile
from mutator.mutants.skeletons import compiles, skeleton
from mutator.mutants.splicing import Edit, in_order

Shape = tuple[tuple[int, int, int, bytes, str], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Change:
    """A changed file: its new content, and the patch that makes it (no UTF-8: surrogate escapes)."""

    data: bytes
    patch: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Mold:
    """A change without its inserted lines: what stands before, between and after them."""

    data: tuple[bytes, ...]
    patch: tuple[str, ...]

    @classmethod
    def of(cls, change: Change) -> "Mold":
        """The mold of a change. Its inserted lines are the tagged ones: no other line of a target is."""
        patch = change.patch.encode("utf-8", "surrogateescape")
        return cls(data=tuple(_cut(change.data, b"")), patch=tuple(_text(part) for part in _cut(patch, b"+")))

    def filled(self, lines: Sequence[bytes]) -> Change:
        """The change with these lines (without their ends) inserted."""
        data: list[bytes] = [b""] * (2 * len(lines) + 1)
        patch = [""] * len(data)
        data[::2], data[1::2] = self.data, lines
        patch[::2], patch[1::2] = self.patch, map(_text, lines)
        return Change(data=b"".join(data), patch="".join(patch))


def shape_of(file: ParsedFile, edits: Sequence[Edit], ids: Sequence[str]) -> Shape:
    """What makes edits of a file alike, so that they have one mold; `ids` are those in their lines."""
    return tuple(
        (e.index, e.rank, e.reindent, e.unit, skeleton(b"".join(e.lines).decode(file.encoding), ids))
        for e in in_order(edits)
    )


def lines_of(edits: Sequence[Edit]) -> list[bytes]:
    """The inserted lines from the top of the file to its end, without their ends."""
    return [line.rstrip(b"\r\n") for line in chain.from_iterable(e.lines for e in in_order(edits))]


def proven(file: ParsedFile, mold: Mold, shape: Shape) -> bool:
    """Whether whatever this shape's mold is filled with compiles: filled with the skeletons it does.

    Then it un-splices as well, since that looks at the tags alone, which are part of the shape.
    """
    lines = "".join(text for *_, text in shape).encode(file.encoding).splitlines()
    return compiles(mold.filled(lines).data)


def _cut(data: bytes, sign: bytes) -> list[bytes]:
    """What stands around the tagged lines; `sign` and line ends stay."""
    parts = [b""]
    for line in data.splitlines(keepends=True):
        if TAG.search(line):
            parts[-1] += sign
            parts.append(line[len(line.rstrip(b"\r\n")) :])
        else:
            parts[-1] += line
    return parts


def _text(data: bytes) -> str:
    return data.decode("utf-8", "surrogateescape")
