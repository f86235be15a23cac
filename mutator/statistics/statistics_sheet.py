"""A table that can be written as Markdown and CSV."""

import csv
import io
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from mutator._common.table_rendering import TextTable
from mutator.statistics.shares_with_intervals import Share

if TYPE_CHECKING:
    import pandas as pd

_SHARE_HEADINGS = ("count", "of", "rate", "low", "high")


class PValue(float):
    """A p-value. Very small ones are displayed as a bound, because the approximation is no more precise."""

    def __str__(self) -> str:
        return "< 0.0001" if self < 0.0001 else f"{float(self):.4f}"


class PercentRate(float):
    """A share alone, displayed in %."""

    def __str__(self) -> str:
        return "-" if math.isnan(self) else f"{100 * float(self):.1f} %"


SheetCell = Share | float | int | str | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Sheet:
    """One table. `name` is the file name, and `note` says what is counted. Each line has a cell for each
    heading.
    """

    name: str
    title: str
    note: str
    heads: tuple[str, ...]
    lines: tuple[tuple[SheetCell, ...], ...]

    def table(self) -> TextTable:
        return TextTable(heads=self.heads, rows=[[cell_text(cell) for cell in line] for line in self.lines])

    def as_markdown(self) -> str:
        return f"## {self.title}\n\n{self.note}\n\n{self.table().as_markdown()}\n"

    def as_csv(self) -> str:
        """Return the table as CSV. A share becomes five columns: count, of, rate, and both ends of its
        interval (fractions).
        """
        columns, lines = self._with_shares_unfolded(_csv_number)
        out = io.StringIO()
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows(lines)
        return out.getvalue()

    def as_frame(self) -> "pd.DataFrame":
        """Return the columns of the CSV as a pandas frame, with full precision."""
        import pandas as pd

        columns, lines = self._with_shares_unfolded(float)
        return pd.DataFrame(lines, columns=columns)

    def _with_shares_unfolded(
        self, number: Callable[[float], object]
    ) -> tuple[list[str], list[list[object]]]:
        wide = [any(isinstance(line[i], Share) for line in self.lines) for i in range(len(self.heads))]
        columns = [
            name
            for head, is_wide in zip(self.heads, wide, strict=True)
            for name in ([f"{head}: {part}" for part in _SHARE_HEADINGS] if is_wide else [head])
        ]
        return columns, [_line_values(line, wide, number) for line in self.lines]


def _line_values(
    line: Sequence[SheetCell], wide: Sequence[bool], number: Callable[[float], object]
) -> list[object]:
    values: list[object] = []
    for cell, is_wide in zip(line, wide, strict=True):
        if isinstance(cell, Share):
            values += [cell.count, cell.of, *map(number, (cell.rate, cell.low, cell.high))]
        else:
            value = number(cell) if isinstance(cell, float) else cell
            values += [value, *[None] * (len(_SHARE_HEADINGS) - 1)] if is_wide else [value]
    return values


def _csv_number(value: float) -> str:
    return "" if math.isnan(value) else f"{value:.6g}"


def cell_text(cell: SheetCell) -> str:
    if cell is None or (isinstance(cell, float) and math.isnan(cell)):
        return "-"
    return (
        str(cell) if isinstance(cell, PValue | PercentRate) or not isinstance(cell, float) else f"{cell:.3g}"
    )
