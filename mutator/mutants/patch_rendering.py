"""Writes patches: unified diffs in git's style, for `patch -p1`."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field

from mutator.mutants.splicing import PatchPiece

_CONTEXT_LINES = 3  # as many as `diff -u` and git write, so that `patch` finds each place as usual
_NO_NEWLINE_NOTE = "\\ No newline at end of file\n"


@dataclass(slots=True)
class _Hunk:
    """Pieces shown together, and the number of lines before them in the old and the new file."""

    old_lines_before: int
    new_lines_before: int
    pieces: list[PatchPiece] = field(default_factory=list)

    def render(self) -> str:
        old = _render_span(self.old_lines_before, _count_lines_of_side(self.pieces, "-"))
        new = _render_span(self.new_lines_before, _count_lines_of_side(self.pieces, "+"))
        body = "".join(_render_line(piece.sign, line) for piece in self.pieces for line in piece.lines)
        return f"@@ -{old} +{new} @@\n{body}"


def render_changed_file(path: str, pieces: Iterable[PatchPiece]) -> str:
    """Return the patch of one changed file; bytes that are not UTF-8 become surrogate escapes."""
    hunks = "".join(hunk.render() for hunk in _split_into_hunks([p for p in pieces if p.lines]))
    return f"diff --git a/{path} b/{path}\n--- a/{_render_path(path)}\n+++ b/{_render_path(path)}\n{hunks}"


def render_new_file(path: str, text: str) -> str:
    """Return the patch that adds a file with this text, whose lines end with LF."""
    lines, end = text.removesuffix("\n"), "" if text.endswith("\n") else _NO_NEWLINE_NOTE
    body = "+" + lines.replace("\n", "\n+")
    return (
        f"diff --git a/{path} b/{path}\nnew file mode 100644\n--- /dev/null\n+++ b/{_render_path(path)}\n"
        f"@@ -0,0 +1,{lines.count(chr(10)) + 1} @@\n{body}\n{end}"
    )


def _split_into_hunks(pieces: Sequence[PatchPiece]) -> Iterator[_Hunk]:
    """Yield changes with three lines of context; changes at most six lines apart share a hunk."""
    hunk = _Hunk(0, 0)
    old = new = 0
    for i, piece in enumerate(pieces):
        if piece.sign == " ":
            before, after = i > 0, i < len(pieces) - 1
            if before and after and len(piece.lines) <= 2 * _CONTEXT_LINES:
                hunk.pieces.append(piece)
            else:
                if before:
                    hunk.pieces.append(PatchPiece(sign=" ", lines=piece.lines[:_CONTEXT_LINES]))
                    yield hunk
                tail = piece.lines[-_CONTEXT_LINES:]
                behind = len(piece.lines) - len(tail)
                hunk = _Hunk(old + behind, new + behind, [PatchPiece(sign=" ", lines=tail)])
        else:
            hunk.pieces.append(piece)
        old += _count_lines_of_side([piece], "-")
        new += _count_lines_of_side([piece], "+")
    if any(piece.sign != " " for piece in hunk.pieces):
        yield hunk


def _count_lines_of_side(pieces: Iterable[PatchPiece], sign: str) -> int:
    return sum(len(piece.lines) for piece in pieces if piece.sign in (" ", sign))


def _render_span(before: int, count: int) -> str:
    """Return `start,count` of one side of a hunk; `start` of an empty side is the line before it."""
    return f"{before + 1 if count else before},{count}"


def _render_path(path: str) -> str:
    """End a name that has a space with a tab; otherwise `patch` reads the part after the space as a date."""
    return f"{path}\t" if " " in path else path


def _render_line(sign: str, line: bytes) -> str:
    text = sign + line.decode("utf-8", "surrogateescape")
    return text if text.endswith("\n") else f"{text}\n{_NO_NEWLINE_NOTE}"
