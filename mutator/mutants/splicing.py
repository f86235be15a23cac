"""The splicer: inserts tagged lines between the lines of a source file, and removes them again.

Edits are whole lines, so all other bytes stay unchanged, such as line ends, tabs and comments. A guard also
indents the statement that it wraps; its tag states the number of indented lines. A line with a changed
expression is replaced by one that keeps the old line in its tag.
"""

from codecs import BOM_UTF8
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import IntEnum
from itertools import pairwise

from mutator.errors import MutatorError
from mutator.mutants.anchors import ParsedFile, Site
from mutator.mutants.constants_and_defaults import FixedValue
from mutator.mutants.expressions import Expression
from mutator.mutants.injected_lines import asks, changed_value, import_statement, tag_instead, tag_of, tagged


class Rank(IntEnum):
    """The order of edits at one line index."""

    AFTER = 0  # lines inserted after the previous line
    AFTER_WHOLE = 1  # lines inserted after a whole statement that ends on the previous line
    BEFORE = 2  # lines inserted before the line itself
    GUARD = 3  # a guard around the line
    INSTEAD = 4  # a replacement of the line


@dataclass(frozen=True, slots=True, kw_only=True)
class Edit:
    """Lines to insert before line `index`; the `reindent` lines that follow are indented by `unit`.

    An edit of rank INSTEAD replaces line `index`.
    """

    index: int
    rank: Rank
    lines: tuple[bytes, ...]
    reindent: int = 0
    unit: bytes = b""


@dataclass(frozen=True, slots=True, kw_only=True)
class ValueEdit:
    """The bytes to write before and after an expression, so that its value can become that of `changed`.

    `start` and `end` are a line and a byte offset, from 0.
    """

    start: tuple[int, int]
    end: tuple[int, int]
    before: bytes
    after: bytes
    changed: str
    tag: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Piece:
    """Consecutive lines with one sign: kept (' '), removed ('-') or added ('+')."""

    sign: str
    lines: tuple[bytes, ...]


def insertion(file: ParsedFile, site: Site, code: Sequence[str], tag: str) -> Edit:
    """Return the edit that inserts `code` (4 spaces per indentation level) at `site`, each line tagged."""
    lines = _lines(file, site, code, tag)
    index, rank = (site.last, Rank.AFTER) if site.after else (site.first, Rank.BEFORE)
    return Edit(index=index, rank=rank, lines=lines)


def guard(file: ParsedFile, site: Site, code: Sequence[str], tag: str) -> Edit:
    """Return the edit that wraps the statement at `site` in `code`, whose last line opens a block."""
    if site.first == site.last or not site.alone or site.after:
        raise MutatorError(
            "a guard needs a statement that is alone on its lines",
            where=file.where,
            line=site.first + 1,
            expected="an anchor `before_call`, `before_assign` or `before_return`",
            remedy="anchor at the statement to omit",
        )
    lines = _lines(file, site, code, tag, site.reindent)
    return Edit(
        index=site.first,
        rank=Rank.GUARD,
        lines=lines,
        reindent=site.reindent,
        unit=_unit(file, site.indent),
    )


def setting(file: ParsedFile, value: FixedValue, code: str, tag: str) -> Edit:
    line = value.indent + _encoded(file, tagged(code, tag), value.first) + file.newline
    return Edit(index=value.index, rank=Rank.AFTER_WHOLE, lines=(line,))


def value_change(
    file: ParsedFile, expression: Expression, changed: str, tag: str, condition: str | None = None
) -> ValueEdit:
    """Return the edit that gives `expression` the value `changed` while the injection `tag` is active.

    `changed` is source on one line. `condition` replaces the default call that asks the probe.
    """
    opened, closed = ("(", "))") if expression.bare else ("", ")")
    return ValueEdit(
        start=expression.start,
        end=expression.end,
        before=_encoded(file, changed_value(condition or asks(tag), changed) + opened, expression.start[0]),
        after=closed.encode(),
        changed=changed,
        tag=tag,
    )


def in_lines(file: ParsedFile, edits: Iterable[Edit | ValueEdit]) -> list[Edit]:
    """Convert edits of values to edits that replace whole lines of the target; other edits are unchanged."""
    edits = list(edits)
    values = sorted((e for e in edits if isinstance(e, ValueEdit)), key=lambda e: e.start)
    for one, following in pairwise(values):
        if following.start < one.end:
            raise MutatorError(
                "two injections into one expression",
                where=file.where,
                line=following.start[0] + 1,
                expected="expressions that do not overlap",
                remedy="remove one of the injections",
            )
    texts_by_line: dict[int, list[tuple[int, bytes, str]]] = defaultdict(list)
    for edit in values:
        texts_by_line[edit.start[0]].append((edit.start[1], edit.before, edit.tag))
        texts_by_line[edit.end[0]].append((edit.end[1], edit.after, edit.tag))
    lines = [_instead(file, index, texts) for index, texts in texts_by_line.items()]
    return [*(edit for edit in edits if isinstance(edit, Edit)), *lines]


def _instead(file: ParsedFile, index: int, texts: Sequence[tuple[int, bytes, str]]) -> Edit:
    whole = file.lines[index]
    original = whole.rstrip(b"\r\n")
    line = original
    for column, text, _ in reversed(texts):
        line = line[:column] + text + line[column:]
    tag = tag_instead(dict.fromkeys(tag for *_, tag in texts), original)
    return Edit(index=index, rank=Rank.INSTEAD, lines=(line + tag + whole[len(original) :],))


def probe_import(file: ParsedFile, package: str | None) -> Edit:
    if file.import_line == 0 and file.data.startswith(BOM_UTF8):
        raise MutatorError(
            "a byte order mark right before the first statement",
            where=file.where,
            line=1,
            expected="a comment or docstring after the mark, or no mark",
            remedy="save the file without a byte order mark",
        )
    line = import_statement(package).encode(file.encoding)
    return Edit(index=file.import_line, rank=Rank.BEFORE, lines=(line + file.newline,))


def _unit(file: ParsedFile, indent: bytes) -> bytes:
    return b"\t" if indent.endswith(b"\t") else file.indent_unit


def _lines(
    file: ParsedFile, site: Site, code: Sequence[str], tag: str, guarded: int = 0
) -> tuple[bytes, ...]:
    unit = _unit(file, site.indent)
    result = []
    for line in code:
        body = line.lstrip(" ")
        levels = (len(line) - len(body)) // 4
        text = _encoded(file, tagged(body, tag, guarded), site.first)
        result.append(site.indent + unit * levels + text + file.newline)
    return tuple(result)


def _encoded(file: ParsedFile, text: str, line: int) -> bytes:
    try:
        return text.encode(file.encoding)
    except UnicodeEncodeError:
        raise MutatorError(
            f"{text!r} cannot be encoded in {file.encoding}",
            where=file.where,
            line=line + 1,
            expected="characters that the file's encoding has",
            remedy="use other names",
        ) from None


def in_order(edits: Iterable[Edit]) -> list[Edit]:
    """Sort edits from the top of the file to its end; edits of equal index and rank keep their order.

    Exception: lines inserted after a class follow those inserted after its last function.
    """
    return sorted(edits, key=lambda e: (e.index, e.rank, -_depth(e)))


def _depth(edit: Edit) -> int:
    return len(_margin(edit.lines[0])) if edit.rank is Rank.AFTER_WHOLE else 0


def apply_edits(file: ParsedFile, edits: Iterable[Edit]) -> tuple[Piece, ...]:
    """Return the edited file as pieces, for `joined`; MutatorError if two guards wrap one statement."""
    pieces: list[Piece] = []
    next_line = 0
    for edit in in_order(edits):
        if edit.index < next_line:
            raise MutatorError(
                "two guards around one statement, or an injection inside a guarded one",
                where=file.where,
                line=edit.index + 1,
                expected="one guard per statement, and no other injection in it",
                remedy="remove one of the injections",
            )
        _keep(pieces, file.lines[next_line : edit.index])
        next_line = edit.index
        added = list(edit.lines)
        if next_line and edit.index == len(file.lines):
            added = _end_of_file(pieces, added, file.newline)
        if edit.rank is Rank.INSTEAD:
            pieces.append(Piece(sign="-", lines=file.lines[edit.index : edit.index + 1]))
            next_line += 1
        if edit.reindent:
            next_line += edit.reindent
            wrapped = file.lines[edit.index : next_line]
            pieces.append(Piece(sign="-", lines=wrapped))
            added += _indented(wrapped, edit.unit)
        pieces.append(Piece(sign="+", lines=tuple(added)))
    _keep(pieces, file.lines[next_line:])
    return tuple(pieces)


def _keep(pieces: list[Piece], lines: tuple[bytes, ...]) -> None:
    if lines:
        pieces.append(Piece(sign=" ", lines=lines))


def _indented(lines: Sequence[bytes], unit: bytes) -> tuple[bytes, ...]:
    """Indent lines by one level. The first gets `unit` after its own indentation, so that tabs and spaces do
    not mix.
    """
    start = len(_margin(lines[0]))
    first = lines[0][:start] + unit + lines[0][start:]
    return (first, *(unit + line if line.strip() else line for line in lines[1:]))


def _margin(line: bytes) -> bytes:
    return line[: len(line) - len(line.lstrip(b" \t\f"))]


def _end_of_file(pieces: list[Piece], added: list[bytes], newline: bytes) -> list[bytes]:
    """If the file does not end in a newline, move the newline of the last added line to the old last line."""
    last = pieces[-1]
    if last.lines[-1].endswith((b"\n", b"\r")):
        return added
    pieces[-1] = Piece(sign=last.sign, lines=last.lines[:-1])
    if last.sign == " ":
        pieces.append(Piece(sign="-", lines=last.lines[-1:]))
    pieces.append(Piece(sign="+", lines=(last.lines[-1] + newline,)))
    added[-1] = added[-1].removesuffix(newline)
    return added


def joined(pieces: Iterable[Piece]) -> bytes:
    return b"".join(line for piece in pieces if piece.sign != "-" for line in piece.lines)


def unsplice(data: bytes) -> bytes:
    """Return the original bytes of a mutated file."""
    lines = data.splitlines(keepends=True)
    result: list[bytes] = []
    indented_count = 0  # lines still indented by a guard
    margin = unit = b""
    for line in lines:
        tag = tag_of(line)
        if tag and tag.was is not None:
            result.append(tag.was + line[len(line.rstrip(b"\r\n")) :])
        elif tag:
            indented_count = tag.guarded
            margin, unit = _margin(line), b""
        elif indented_count and not unit:
            unit = _margin(line)[len(margin) :]
            result.append(margin + line[len(margin) + len(unit) :])
            indented_count -= 1
        elif indented_count:
            result.append(line[len(unit) :] if line.strip() else line)
            indented_count -= 1
        else:
            result.append(line)
    if result and tag_of(lines[-1]) and not lines[-1].endswith((b"\n", b"\r")):
        result[-1] = result[-1].rstrip(b"\r\n")
    return b"".join(result)
