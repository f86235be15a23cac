"""Render tables as plain text, Markdown and HTML."""

import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from markupsafe import Markup

# text that Markdown would read as an element, italics or bold; `code` is exempt
_MARKUP_PATTERN = re.compile(
    r"`[^`]*`|<(?=[A-Za-z/!?])|\*(?=\S)|(?<=\S)\*|(?<![A-Za-z0-9])_+|_+(?![A-Za-z0-9])"
)


@dataclass(frozen=True, slots=True, kw_only=True)
class TextTable:
    """A table of texts, with one cell per head in each row. Columns in `right_aligned` are right-aligned.

    Markup in a cell, e.g. a link, is not escaped in HTML. With `has_row_headings`, the first
    cell of a row is a heading.
    """

    heads: Sequence[str]
    rows: Sequence[Sequence[str]]
    right_aligned: Collection[int] = ()
    has_row_headings: bool = False

    def as_text(self) -> str:
        """Return the table as text, without trailing spaces."""
        lines = [self.heads, *self.rows]
        widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
        return "\n".join(self._pad_line(line, widths) for line in lines)

    def _pad_line(self, cells: Sequence[str], widths: Sequence[int]) -> str:
        pairs = enumerate(zip(cells, widths, strict=True))
        return "  ".join(
            c.rjust(w) if i in self.right_aligned else c.ljust(w) for i, (c, w) in pairs
        ).rstrip()

    def as_markdown(self, *, escape: bool = True) -> str:
        """Return the table in Markdown; with `escape=False`, the cells are already Markdown."""

        def line(cells: Sequence[str]) -> str:
            texts = [escaped_markdown_line(c).replace("|", "\\|") for c in cells] if escape else cells
            return f"| {' | '.join(texts)} |"

        rule = f"|{'---|' * len(self.heads)}"
        return "\n".join([line(self.heads), rule, *map(line, self.rows)])

    def as_html(self, css_class: str = "") -> "Markup":
        """Return a scrollable HTML table of class `style`, without a head row if all heads are empty.

        A row with an empty first cell continues the row above and has the class `group`; cells of columns in
        `right_aligned` have the class `number`.
        """
        from markupsafe import Markup

        cells = [Markup("<td>{}</td>").format] * len(self.heads)
        for index in self.right_aligned:
            cells[index] = Markup('<td class="number">{}</td>').format
        if self.has_row_headings:
            cells[0] = Markup('<th scope="row">{}</th>').format
        rows = [
            Markup("<tr{}>{}</tr>\n").format(
                Markup("" if row[0] else ' class="group"'),
                Markup("").join(cell(text) for cell, text in zip(cells, row, strict=True)),
            )
            for row in self.rows
        ]
        return Markup(
            '<div class="scroll" tabindex="0" role="group" aria-label="Table"><table class="{}">\n'
            "{}<tbody>\n{}</tbody></table></div>"
        ).format(css_class, self._html_head(), Markup("").join(rows))

    def _html_head(self) -> "Markup":
        from markupsafe import Markup

        if not any(self.heads):
            return Markup("")
        tags = ("<td>{1}</td>", '<th scope="col"{0}>{1}</th>')  # an empty head becomes a plain cell
        numbers = Markup(' class="number"')
        heads = [
            Markup(tags[bool(head)]).format(numbers if i in self.right_aligned else "", head)
            for i, head in enumerate(self.heads)
        ]
        return Markup("<thead><tr>{}</tr></thead>\n").format(Markup("").join(heads))


def escaped_markdown_line(text: str) -> str:
    """Convert text to one line of Markdown that shows every character, even in `<class 'float'>` and
    `__init__`.
    """
    return _MARKUP_PATTERN.sub(_escape_match, " ".join(text.splitlines()))


def _escape_match(match: re.Match[str]) -> str:
    text = match[0]
    if text[0] == "`":
        return text
    return "&lt;" if text == "<" else "".join("\\" + character for character in text)
