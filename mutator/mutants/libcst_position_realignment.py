"""Moves LibCST's positions to where the nodes are in a file that LibCST does not reproduce.

LibCST leaves out some blanks, form feeds and backslashes. Its positions count in the text that it would
write. Both texts have the same other characters in the same order, and nodes begin and end at those.
"""

import re
from bisect import bisect_left, bisect_right

from libcst.metadata import CodePosition, CodeRange

from mutator.mutants.positions_of_both_parsers import RangeByNode

_LINE_END_PATTERN = re.compile(r"\r\n|\r|\n")
_CHARACTERS_LIBCST_LOSES = frozenset(" \t\f\r\n\\")


class _TextWithoutLayout:
    def __init__(self, text: str) -> None:
        self.text = text
        self.line_starts = [0, *(match.end() for match in _LINE_END_PATTERN.finditer(text))]
        self.kept_offsets = [i for i, c in enumerate(text) if c not in _CHARACTERS_LIBCST_LOSES]

    @property
    def text_without_layout(self) -> str:
        return "".join(self.text[i] for i in self.kept_offsets)

    def offset_of(self, position: CodePosition) -> int:
        if position.line > len(self.line_starts):  # the text lacks its last line end
            return len(self.text)
        return self.line_starts[position.line - 1] + position.column

    def position_at(self, offset: int) -> CodePosition:
        line = bisect_right(self.line_starts, offset)
        return CodePosition(line, offset - self.line_starts[line - 1])


def align_positions(positions: RangeByNode, written: str, original: str) -> RangeByNode | None:
    """Return the positions in the original text; None if LibCST changes more than it may.

    `written` is the text that LibCST writes.
    """
    new, old = _TextWithoutLayout(written), _TextWithoutLayout(original)
    if new.text_without_layout != old.text_without_layout:
        return None
    offsets = [*old.kept_offsets, len(original)]

    def moved(span: CodeRange) -> CodeRange:
        first = bisect_left(new.kept_offsets, new.offset_of(span.start))
        behind_last = bisect_left(new.kept_offsets, new.offset_of(span.end))
        end = offsets[behind_last - 1] + 1 if behind_last > first else offsets[first]
        return CodeRange(old.position_at(offsets[first]), old.position_at(end))

    return {node: moved(span) for node, span in positions.items()}
