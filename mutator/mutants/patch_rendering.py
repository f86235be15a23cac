"""Writes patches: unified diffs in git's style, for `patch -p1`."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field

from mutator.mutants.splicing import Piece

_CONTEXT = 3
_NO_NEWLINE = "\\ No newline at end of file\n"


@dataclass(slots=True)
class _Hunk:
    """Pieces shown together, and the number of lines before them in the old and the new file."""

    old: int
    new: int
    pieces: list[Piece] = field(default_factory=list)

    def text(self) -> str:
        old, new = _count(self.pieces, "-"), _count(self.pieces, "+")
        body = "".join(_line(piece.sign, line) for piece in self.pieces for line in piece.lines)
        return f"@@ -{_span(self.old, old)} +{_span(self.new, new)} @@\n{body}"


def changed_file(path: str, pieces: Iterable[Piece]) -> str:
    """Return the patch of one changed file; bytes that are not UTF-8 become surrogate escapes."""
    hunks = "".join(hunk.text() for hunk in _hunks([p for p in pieces if p.lines]))
    return f"diff --git a/{path} b/{path}\n--- a/{_name(path)}\n+++ b/{_name(path)}\n{hunks}"


def new_file(path: str, text: str) -> str:
    """Return the patch that adds a file with this text, whose lines end with LF."""
    lines, end = text.removesuffix("\n"), "" if text.endswith("\n") else _NO_NEWLINE
    body = "+" + lines.replace("\n", "\n+")
    return (
        f"diff --git a/{path} b/{path}\nnew file mode 100644\n--- /dev/null\n+++ b/{_name(path)}\n"
        f"@@ -0,0 +1,{lines.count(chr(10)) + 1} @@\n{body}\n{end}"
    )


def _hunks(pieces: Sequence[Piece]) -> Iterator[_Hunk]:
    """Yield changes with three lines of context; changes at most six lines apart share a hunk."""
    hunk = _Hunk(0, 0)
    old = new = 0
    for i, piece in enumerate(pieces):
        if piece.sign == " ":
            before, after = i > 0, i < len(pieces) - 1
            if before and after and len(piece.lines) <= 2 * _CONTEXT:
                hunk.pieces.append(piece)
            else:
                if before:
                    hunk.pieces.append(Piece(sign=" ", lines=piece.lines[:_CONTEXT]))
                    yield hunk
                tail = piece.lines[-_CONTEXT:]
                behind = len(piece.lines) - len(tail)
                hunk = _Hunk(old + behind, new + behind, [Piece(sign=" ", lines=tail)])
        else:
            hunk.pieces.append(piece)
        old += _count([piece], "-")
        new += _count([piece], "+")
    if any(piece.sign != " " for piece in hunk.pieces):
        yield hunk


def _count(pieces: Iterable[Piece], sign: str) -> int:
    return sum(len(piece.lines) for piece in pieces if piece.sign in (" ", sign))


def _span(before: int, count: int) -> str:
    """Return `start,count` of one side of a hunk; `start` of an empty side is the line before it."""
    return f"{before + 1 if count else before},{count}"


def _name(path: str) -> str:
    """End a name that has a space with a tab; otherwise `patch` reads the part after the space as a date."""
    return f"{path}\t" if " " in path else path


def _line(sign: str, line: bytes) -> str:
    text = sign + line.decode("utf-8", "surrogateescape")
    return text if text.endswith("\n") else f"{text}\n{_NO_NEWLINE}"
