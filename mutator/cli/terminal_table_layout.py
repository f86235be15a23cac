"""Lay out a table for the width of a terminal, without breaking a word.

A table that is too wide folds long texts between words. If that is not enough, an entry takes two lines in a
narrow terminal; in a wide one, and where two lines are not enough, the least important columns are left out.
"""

import textwrap
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass

from mutator._common.message_text import NO_BREAK_SPACE, unbreakable_parts, with_unbreakable_units

GAP = "  "
INDENT = "  "  # of an entry's second line
TWO_LINES_BELOW_WIDTH = 100  # columns of a terminal
LEAST_TEXT_WIDTH = 28  # a longer text is not folded into a narrower column

StyledLine = list[tuple[str, str]]  # pairs of text and style


@dataclass(frozen=True, slots=True)
class PlacedColumn:
    """A column of the table, by its number, and its width."""

    index: int
    width: int


@dataclass(frozen=True, slots=True)
class TableLayout:
    """Where the columns of a table stand: the columns in each line of an entry, and those left out."""

    lines: tuple[tuple[PlacedColumn, ...], ...]
    dropped: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class TerminalTable:
    """A table of texts, with one cell per head in each row.

    `priorities` numbers the most important columns, the first one most; the others follow from left to right.
    With `last_is_whole`, cells of the last column are never folded; one can be longer than the line.
    """

    heads: Sequence[str]
    rows: Sequence[Sequence[str]]
    right_aligned: Collection[int] = ()
    priorities: Sequence[int] = ()
    last_is_total: bool = False
    last_is_whole: bool = False

    def layout(self, width: int | None) -> TableLayout:
        """Return the layout for a terminal of so many columns; None: as wide as the table."""
        widths = list(map(_column_widths, zip(self.heads, *self.rows, strict=True)))
        if self.last_is_whole:
            head = len(self.heads[-1])
            widths[-1] = _ColumnWidths(natural=widths[-1].natural, with_folded_head=head, least=head)
        return _LayoutSearch(widths, self._by_importance()).search(width)

    def _by_importance(self) -> list[int]:
        return list(dict.fromkeys([*self.priorities, *range(len(self.heads))]))

    def as_lines(
        self, layout: TableLayout, style_by_cell: dict[str, str], rule: str = "─"
    ) -> list[StyledLine]:
        """Return the lines to print: heads, a rule, and the rows; `rule` is a character."""
        width = max(_line_width(columns) + len(INDENT) * (i > 0) for i, columns in enumerate(layout.lines))
        rule_line: StyledLine = [(rule * width, "")]
        lines = [*self._entry_lines(self.heads, layout, ["bold"] * len(self.heads)), rule_line]
        for number, row in enumerate(self.rows, start=1):
            is_total = self.last_is_total and number == len(self.rows)
            if is_total and number > 1:
                lines.append(rule_line)
            lines += self._entry_lines(
                row, layout, [style_by_cell.get(cell, "bold" if is_total else "") for cell in row]
            )
        return lines

    def _entry_lines(
        self, cells: Sequence[str], layout: TableLayout, styles: Sequence[str]
    ) -> list[StyledLine]:
        lines: list[StyledLine] = []
        for i, columns in enumerate(layout.lines):
            folded = [self._fold(cells[column.index], column) for column in columns]
            for parts in zip(*_padded_to_equal_length(folded), strict=True):
                line: StyledLine = [(INDENT, "")] if i else []
                for column, text in zip(columns, parts, strict=True):
                    padded = text.rjust if column.index in self.right_aligned else text.ljust
                    line += [(padded(column.width), styles[column.index]), (GAP, "")]
                lines.append(_without_trailing_spaces(line))
        # a second line without any text says nothing
        return [line for i, line in enumerate(lines) if line or i == 0]

    def _fold(self, cell: str, column: PlacedColumn) -> list[str]:
        is_whole = self.last_is_whole and column.index == len(self.heads) - 1
        return [cell] if is_whole else _fold(cell, column.width)


@dataclass(frozen=True, slots=True)
class _ColumnWidths:
    """The widths of a column: without folding, with only its head folded, and with everything folded."""

    natural: int
    with_folded_head: int
    least: int


def _column_widths(column: Sequence[str]) -> _ColumnWidths:
    """Return the widths of a head with its cells."""
    head, *cells = map(with_unbreakable_units, column)
    of_cells = max((len(line) for cell in cells for line in cell.split("\n")), default=0)
    longest = max(len(part) for cell in column for part in unbreakable_parts(cell))
    return _ColumnWidths(
        natural=max(len(head), of_cells),
        with_folded_head=max(longest, of_cells),
        least=max(longest, min(of_cells, LEAST_TEXT_WIDTH)),
    )


class _LayoutSearch:
    """Search the layout that shows the most of columns with these widths."""

    def __init__(self, widths: Sequence[_ColumnWidths], by_importance: Sequence[int]) -> None:
        self._widths, self._by_importance = widths, by_importance

    def search(self, width: int | None) -> TableLayout:
        indices = list(range(len(self._widths)))
        if width is None:
            return TableLayout((self._unfolded(indices),))
        if columns := self._fit(indices, width):
            return TableLayout((columns,))
        if width < TWO_LINES_BELOW_WIDTH:
            return self._two_lines(indices, width)
        columns, dropped = self._fit_most(indices, width)
        return TableLayout((columns,), dropped)

    def _two_lines(self, indices: list[int], width: int) -> TableLayout:
        count = 1
        while count < len(indices) and self._fit(indices[: count + 1], width, only_heads=True):
            count += 1
        first = self._fit(indices[:count], width) or self._unfolded(indices[:count])
        second, dropped = self._fit_most(indices[count:], width - len(INDENT))
        return TableLayout((first, second) if second else (first,), dropped)

    def _fit_most(self, indices: list[int], width: int) -> tuple[tuple[PlacedColumn, ...], tuple[int, ...]]:
        """Return the placed columns, and those that were left out. The most important one always stays."""
        remaining = list(indices)
        dropped: list[int] = []
        for index in reversed([index for index in self._by_importance if index in indices]):
            if columns := self._fit(remaining, width):
                return columns, tuple(sorted(dropped))
            if index == self._by_importance[0]:
                break
            remaining.remove(index)
            dropped.append(index)
        return self._unfolded(remaining), tuple(sorted(dropped))

    def _fit(
        self, indices: Sequence[int], width: int, *, only_heads: bool = False
    ) -> tuple[PlacedColumn, ...]:
        """Return the columns, folded as far as needed; nothing if they do not fit."""
        columns = [self._widths[index] for index in indices]
        least = [column.with_folded_head if only_heads else column.least for column in columns]
        spare = width - len(GAP) * (len(indices) - 1) - sum(least)
        if spare < 0:
            return ()
        missing_widths = [column.natural - size for column, size in zip(columns, least, strict=True)]
        more = _share_out_width(spare, missing_widths)
        return tuple(
            PlacedColumn(i, size + extra) for i, size, extra in zip(indices, least, more, strict=True)
        )

    def _unfolded(self, indices: Iterable[int]) -> tuple[PlacedColumn, ...]:
        return tuple(PlacedColumn(index, self._widths[index].natural) for index in indices)


def _share_out_width(spare: int, missing_widths: Sequence[int]) -> list[int]:
    """Share what is spare out among columns that want so much more; those that want little get all of it."""
    shares = [0] * len(missing_widths)
    waiting = len(missing_widths)
    for i in sorted(range(len(missing_widths)), key=missing_widths.__getitem__):
        shares[i] = min(missing_widths[i], spare // waiting)
        spare -= shares[i]
        waiting -= 1
    return shares


def _line_width(columns: Sequence[PlacedColumn]) -> int:
    return sum(column.width for column in columns) + len(GAP) * (len(columns) - 1)


def _fold(cell: str, width: int) -> list[str]:
    lines = [
        line
        for text in with_unbreakable_units(cell).split("\n")
        for line in textwrap.wrap(text, width, break_long_words=False, break_on_hyphens=False) or [""]
    ]
    return [line.replace(NO_BREAK_SPACE, " ") for line in lines]


def _padded_to_equal_length(columns: list[list[str]]) -> list[list[str]]:
    """Return columns of equally many lines."""
    height = max(map(len, columns))
    return [lines + [""] * (height - len(lines)) for lines in columns]


def _without_trailing_spaces(line: StyledLine) -> StyledLine:
    while line and not line[-1][0].strip():
        line.pop()
    return [*line[:-1], (line[-1][0].rstrip(), line[-1][1])] if line else line
