"""Finds the lines of a file on which statements begin and end, with lines joined by backslashes."""

import io
import tokenize
from bisect import bisect_left, bisect_right
from dataclasses import dataclass

_TOKENS_BETWEEN_STATEMENTS = frozenset(
    (
        tokenize.ENCODING,
        tokenize.NL,
        tokenize.COMMENT,
        tokenize.INDENT,
        tokenize.DEDENT,
        tokenize.ENDMARKER,
    )
)


@dataclass(frozen=True, slots=True)
class LogicalLines:
    """The lines (from 0) on which logical lines begin, and those after their ends."""

    starts: tuple[int, ...]
    ends: tuple[int, ...]

    @classmethod
    def of(cls, data: bytes) -> "LogicalLines":
        lines = data.splitlines()
        starts, ends = list[int](), list[int]()
        for token in tokenize.tokenize(io.BytesIO(data).readline):
            if token.type == tokenize.NEWLINE:
                ends.append(token.start[0])
            elif token.type not in _TOKENS_BETWEEN_STATEMENTS and len(starts) == len(ends):
                start = token.start[0] - 1
                while start and lines[start - 1].strip(b" \t\f\xef\xbb\xbf") == b"\\":
                    start -= 1
                starts.append(start)
        return cls(tuple(starts), tuple(ends))

    def start_of(self, line: int) -> int:
        """Return the first line of the logical line that contains `line`."""
        return self.starts[max(0, bisect_right(self.starts, line) - 1)]

    def end_of(self, line: int) -> int:
        """Return the line after the logical line that contains `line`."""
        return self.ends[bisect_left(self.ends, line + 1)]
