"""The splicer: inserts tagged lines between the lines of a source file, and removes them again.

Edits are whole lines, so all other bytes stay unchanged, such as line ends, tabs and comments. A guard also
indents the statement that it wraps; its tag states the number of indented lines. A line with a changed
expression is replaced by one that keeps the old line in its tag.
"""

from codecs import BOM_UTF8
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from itertools import pairwise

from mutator.errors import MutatorError
from mutator.mutants.changeable_expressions import Expression
from mutator.mutants.constants_and_defaults import ConstantOrDefault
from mutator.mutants.injected_line_syntax import (
    OBSERVATION_TAG,
    active_check_source,
    changed_value_prefix,
    defence_import_line,
    defence_line,
    probe_import_line,
    replacement_tag,
    tag_of,
    tagged_line,
)
from mutator.mutants.parsed_files_and_anchors import ParsedFile, ResolvedAnchor
from mutator.targets.defence_lines import defence_tag_of


class EditRank(IntEnum):
    """The order of edits at one line index."""

    AFTER_PREVIOUS_LINE = 0  # lines inserted after the previous line
    AFTER_WHOLE_STATEMENT = 1  # lines inserted after a whole statement that ends on the previous line
    BEFORE = 2  # lines inserted before the line itself
    GUARD = 3  # a guard around the line
    INSTEAD = 4  # a replacement of the line


@dataclass(frozen=True, slots=True, kw_only=True)
class LineEdit:
    """Lines to insert before line `line_index`; `indented_line_count` lines that follow get `indent_unit`.

    An edit of rank INSTEAD replaces line `line_index`.
    """

    line_index: int
    rank: EditRank
    lines: tuple[bytes, ...]
    indented_line_count: int = 0
    indent_unit: bytes = b""


@dataclass(frozen=True, slots=True, kw_only=True)
class ExpressionEdit:
    """The bytes to write before and after an expression, so that its value can become that of `changed`.

    `start` and `end` are a line and a byte offset, from 0.
    """

    start: tuple[int, int]
    end: tuple[int, int]
    inserted_before: bytes
    inserted_after: bytes
    changed: str
    tag: str


@dataclass(frozen=True, slots=True, kw_only=True)
class PatchPiece:
    """Consecutive lines with one sign: kept (' '), removed ('-') or added ('+')."""

    sign: str
    lines: tuple[bytes, ...]


def insertion_edit(file: ParsedFile, anchor: ResolvedAnchor, code: Sequence[str], tag: str) -> LineEdit:
    """Return the edit that inserts `code` (4 spaces per indentation level) at `anchor`, each line tagged."""
    return _insertion_of_lines(file, anchor, _tagged_lines(file, anchor, code, tag))


def _insertion_of_lines(file: ParsedFile, anchor: ResolvedAnchor, lines: tuple[bytes, ...]) -> LineEdit:
    # at a fault's own place, a defence observes the truth before the fault, and changes commands after it
    if not anchor.inserts_after:
        index = anchor.first_line
        while index and defence_tag_of(file.lines[index - 1]) == "command":
            index -= 1
        return LineEdit(line_index=index, rank=EditRank.BEFORE, lines=lines)
    index = anchor.end_line
    while index < len(file.lines) and defence_tag_of(file.lines[index]) == OBSERVATION_TAG:
        index += 1
    return LineEdit(line_index=index, rank=EditRank.AFTER_PREVIOUS_LINE, lines=lines)


def defence_edit(file: ParsedFile, anchor: ResolvedAnchor, code: str, tag: str) -> LineEdit:
    """Return the edit that inserts a line of a defence at `anchor`, tagged with what it does."""
    text = _encode(file, defence_line(code, tag), anchor.first_line)
    return _insertion_of_lines(file, anchor, (anchor.indent + text + file.newline,))


def defence_import_edit(file: ParsedFile, package: str | None) -> LineEdit:
    line = defence_import_line(package).encode(file.encoding)
    return LineEdit(
        line_index=file.import_insertion_line_index, rank=EditRank.BEFORE, lines=(line + file.newline,)
    )


def guard_edit(file: ParsedFile, anchor: ResolvedAnchor, code: Sequence[str], tag: str) -> LineEdit:
    """Return the edit that wraps the statement at `anchor` in `code`, whose last line opens a block."""
    if anchor.first_line == anchor.end_line or not anchor.is_alone_on_line or anchor.inserts_after:
        raise MutatorError(
            "a guard needs a statement that is alone on its lines",
            where=file.full_path,
            line=anchor.first_line + 1,
            expected="an anchor `before_call`, `before_assign` or `before_return`",
            remedy="anchor at the statement to omit",
        )
    lines = _tagged_lines(file, anchor, code, tag, anchor.indentable_line_count)
    return LineEdit(
        line_index=anchor.first_line,
        rank=EditRank.GUARD,
        lines=lines,
        indented_line_count=anchor.indentable_line_count,
        indent_unit=_indent_unit_of(file, anchor.indent),
    )


def constant_or_default_edit(file: ParsedFile, value: ConstantOrDefault, code: str, tag: str) -> LineEdit:
    line = value.indent + _encode(file, tagged_line(code, tag), value.first_line) + file.newline
    return LineEdit(line_index=value.insertion_line, rank=EditRank.AFTER_WHOLE_STATEMENT, lines=(line,))


def expression_edit(
    file: ParsedFile, expression: Expression, changed: str, tag: str, condition: str | None = None
) -> ExpressionEdit:
    """Return the edit that gives `expression` the value `changed` while the injection `tag` is active.

    `changed` is source on one line. `condition` replaces the default call that asks the probe.
    """
    opened, closed = ("(", "))") if expression.is_bare_tuple_or_walrus else ("", ")")
    return ExpressionEdit(
        start=expression.start,
        end=expression.end,
        inserted_before=_encode(
            file,
            changed_value_prefix(condition or active_check_source(tag), changed) + opened,
            expression.start[0],
        ),
        inserted_after=closed.encode(),
        changed=changed,
        tag=tag,
    )


def as_line_edits(file: ParsedFile, edits: Iterable[LineEdit | ExpressionEdit]) -> list[LineEdit]:
    """Convert edits of values to edits that replace whole lines of the target; other edits are unchanged."""
    edits = list(edits)
    values = sorted((e for e in edits if isinstance(e, ExpressionEdit)), key=lambda e: e.start)
    for earlier, following in pairwise(values):
        if following.start < earlier.end:
            raise MutatorError(
                "two injections into one expression",
                where=file.full_path,
                line=following.start[0] + 1,
                expected="expressions that do not overlap",
                remedy="remove one of the injections",
            )
    texts_by_line: dict[int, list[tuple[int, bytes, str]]] = defaultdict(list)
    for edit in values:
        texts_by_line[edit.start[0]].append((edit.start[1], edit.inserted_before, edit.tag))
        texts_by_line[edit.end[0]].append((edit.end[1], edit.inserted_after, edit.tag))
    lines = [_line_replacement_edit(file, index, texts) for index, texts in texts_by_line.items()]
    return [*(edit for edit in edits if isinstance(edit, LineEdit)), *lines]


def _line_replacement_edit(
    file: ParsedFile, line_index: int, insertions: Sequence[tuple[int, bytes, str]]
) -> LineEdit:
    whole = file.lines[line_index]
    original = whole.rstrip(b"\r\n")
    line = original
    for column, text, _ in reversed(insertions):
        line = line[:column] + text + line[column:]
    tag = replacement_tag(dict.fromkeys(tag for *_, tag in insertions), original)
    return LineEdit(
        line_index=line_index, rank=EditRank.INSTEAD, lines=(line + tag + whole[len(original) :],)
    )


def probe_import_edit(file: ParsedFile, package: str | None) -> LineEdit:
    line = probe_import_line(package).encode(file.encoding)
    return LineEdit(
        line_index=file.import_insertion_line_index, rank=EditRank.BEFORE, lines=(line + file.newline,)
    )


def _indent_unit_of(file: ParsedFile, indent: bytes) -> bytes:
    return b"\t" if indent.endswith(b"\t") else file.indent_unit


def _tagged_lines(
    file: ParsedFile, anchor: ResolvedAnchor, code: Sequence[str], tag: str, guarded_line_count: int = 0
) -> tuple[bytes, ...]:
    unit = _indent_unit_of(file, anchor.indent)
    result = []
    for line in code:
        body = line.lstrip(" ")
        levels = (len(line) - len(body)) // 4
        text = _encode(file, tagged_line(body, tag, guarded_line_count), anchor.first_line)
        result.append(anchor.indent + unit * levels + text + file.newline)
    return tuple(result)


def _encode(file: ParsedFile, text: str, line: int) -> bytes:
    try:
        return text.encode(file.encoding)
    except UnicodeEncodeError:
        raise MutatorError(
            f"{text!r} cannot be encoded in {file.encoding}",
            where=file.full_path,
            line=line + 1,
            expected="characters that the file's encoding has",
            remedy="use other names",
        ) from None


def sort_edits(edits: Iterable[LineEdit]) -> list[LineEdit]:
    """Sort edits from the top of the file to its end; edits of equal index and rank keep their order.

    Exception: lines inserted after a class follow those inserted after its last function.
    """
    return sorted(edits, key=lambda e: (e.line_index, e.rank, -_indentation_depth(e)))


def _indentation_depth(edit: LineEdit) -> int:
    return len(_indentation_of(edit.lines[0])) if edit.rank is EditRank.AFTER_WHOLE_STATEMENT else 0


def apply_edits(file: ParsedFile, edits: Iterable[LineEdit]) -> tuple[PatchPiece, ...]:
    """Return the edited file as pieces for `mutated_bytes`; MutatorError if two guards wrap a statement."""
    pieces: list[PatchPiece] = []
    next_line = 0
    for edit in sort_edits(edits):
        if edit.line_index < next_line:
            raise MutatorError(
                "two guards around one statement, or an injection inside a guarded one",
                where=file.full_path,
                line=edit.line_index + 1,
                expected="one guard per statement, and no other injection in it",
                remedy="remove one of the injections",
            )
        _append_unchanged(pieces, file.lines[next_line : edit.line_index])
        next_line = edit.line_index
        added = list(edit.lines)
        if next_line and edit.line_index == len(file.lines):
            added = _move_last_newline(pieces, added, file.newline)
        if edit.rank is EditRank.INSTEAD:
            pieces.append(PatchPiece(sign="-", lines=file.lines[edit.line_index : edit.line_index + 1]))
            next_line += 1
        if edit.indented_line_count:
            next_line += edit.indented_line_count
            wrapped = file.lines[edit.line_index : next_line]
            pieces.append(PatchPiece(sign="-", lines=wrapped))
            added += _indent_lines(wrapped, edit.indent_unit)
        pieces.append(PatchPiece(sign="+", lines=tuple(added)))
    _append_unchanged(pieces, file.lines[next_line:])
    if file.data.startswith(BOM_UTF8):
        _add_byte_order_mark(pieces)
    return tuple(pieces)


def _add_byte_order_mark(pieces: list[PatchPiece]) -> None:
    """Begin both the original and the new file with a byte order mark, even if their first lines differ."""
    original = next((i for i, piece in enumerate(pieces) if piece.sign != "+"), None)
    if original and pieces[original].sign == " ":  # inserted lines come first
        line, *others = pieces[original].lines
        split = [PatchPiece(sign=sign, lines=(line,)) for sign in "-+"]
        pieces[original : original + 1] = [*split, PatchPiece(sign=" ", lines=tuple(others))]
    for sides in (" -", " +"):
        first = next((i for i, piece in enumerate(pieces) if piece.sign in sides), None)
        if first is not None and not pieces[first].lines[0].startswith(BOM_UTF8):
            line, *others = pieces[first].lines
            pieces[first] = replace(pieces[first], lines=(BOM_UTF8 + line, *others))


def _append_unchanged(pieces: list[PatchPiece], lines: tuple[bytes, ...]) -> None:
    if lines:
        pieces.append(PatchPiece(sign=" ", lines=lines))


def _indent_lines(lines: Sequence[bytes], unit: bytes) -> tuple[bytes, ...]:
    """Indent lines by one level. The first gets `unit` after its own indentation, so that tabs and spaces do
    not mix.
    """
    start = len(_indentation_of(lines[0]))
    first = lines[0][:start] + unit + lines[0][start:]
    return (first, *(unit + line if line.strip() else line for line in lines[1:]))


def _indentation_of(line: bytes) -> bytes:
    return line[: len(line) - len(line.lstrip(b" \t\f"))]


def _move_last_newline(pieces: list[PatchPiece], added: list[bytes], newline: bytes) -> list[bytes]:
    """If the file does not end in a newline, move the newline of the last added line to the old last line."""
    last = pieces[-1]
    if last.lines[-1].endswith((b"\n", b"\r")):
        return added
    pieces[-1] = PatchPiece(sign=last.sign, lines=last.lines[:-1])
    if last.sign == " ":
        pieces.append(PatchPiece(sign="-", lines=last.lines[-1:]))
    pieces.append(PatchPiece(sign="+", lines=(last.lines[-1] + newline,)))
    added[-1] = added[-1].removesuffix(newline)
    return added


def mutated_bytes(pieces: Iterable[PatchPiece]) -> bytes:
    return b"".join(line for piece in pieces if piece.sign != "-" for line in piece.lines)


def unsplice(data: bytes) -> bytes:
    """Return the original bytes of a mutated file."""
    if data.startswith(BOM_UTF8):
        return BOM_UTF8 + unsplice(data.removeprefix(BOM_UTF8))
    lines = data.splitlines(keepends=True)
    result: list[bytes] = []
    remaining = 0  # lines still indented by a guard
    guard_indentation = guard_unit = b""
    for line in lines:
        tag = tag_of(line)
        if tag and tag.replaced_line is not None:
            result.append(tag.replaced_line + line[len(line.rstrip(b"\r\n")) :])
        elif tag:
            remaining = tag.guarded_line_count
            guard_indentation, guard_unit = _indentation_of(line), b""
        elif remaining and not guard_unit:
            guard_unit = _indentation_of(line)[len(guard_indentation) :]
            result.append(guard_indentation + line[len(guard_indentation) + len(guard_unit) :])
            remaining -= 1
        elif remaining:
            result.append(line[len(guard_unit) :] if line.strip() else line)
            remaining -= 1
        else:
            result.append(line)
    if result and tag_of(lines[-1]) and not lines[-1].endswith((b"\n", b"\r")):
        result[-1] = result[-1].rstrip(b"\r\n")
    return b"".join(result)
