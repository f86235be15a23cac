"""The one renderer of tables: plain text for a terminal, Markdown, HTML."""

import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from markupsafe import Markup

# What Markdown would read as an element, italics or bold; nothing in `code` is read so.
_MARKUP = re.compile(r"`[^`]*`|<(?=[A-Za-z/!?])|\*(?=\S)|(?<=\S)\*|(?<![A-Za-z0-9])_+|_+(?![A-Za-z0-9])")


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """A table of texts. Each row has a cell for each head; columns in `right` are aligned to the right."""

    heads: Sequence[str]
    rows: Sequence[Sequence[str]]
    right: Collection[int] = ()

    def as_text(self) -> str:
        """Columns padded to equal width, two spaces between them, no trailing spaces."""
        lines = [self.heads, *self.rows]
        widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
        return "\n".join(self._padded(line, widths) for line in lines)

    def _padded(self, cells: Sequence[str], widths: Sequence[int]) -> str:
        pairs = enumerate(zip(cells, widths, strict=True))
        return "  ".join(c.rjust(w) if i in self.right else c.ljust(w) for i, (c, w) in pairs).rstrip()

    def as_markdown(self, *, escape: bool = True) -> str:
        """A Markdown table; with `escape=False` the cells are Markdown already."""

        def line(cells: Sequence[str]) -> str:
            texts = [markdown_line(c).replace("|", "\\|") for c in cells] if escape else cells
            return f"| {' | '.join(texts)} |"

        rule = f"|{'---|' * len(self.heads)}"
        return "\n".join([line(self.heads), rule, *map(line, self.rows)])

    def as_html(self, style: str = "") -> "Markup":
        """A scrollable HTML table of class `style`, every text escaped.

        A row whose first cell is empty continues the row above it and gets the class `group`.
        """
        from markupsafe import Markup

        cell, head = Markup("<td>{}</td>").format, Markup('<th scope="col">{}</th>').format
        rows = [
            Markup("<tr{}>{}</tr>\n").format(
                Markup("" if row[0] else ' class="group"'), Markup("").join(map(cell, row))
            )
            for row in self.rows
        ]
        return Markup(
            '<div class="scroll" tabindex="0" role="region" aria-label="Table"><table class="{}">\n'
            "<thead><tr>{}</tr></thead>\n<tbody>\n{}</tbody></table></div>"
        ).format(style, Markup("").join(map(head, self.heads)), Markup("").join(rows))


def markdown_line(text: str) -> str:
    """A text as one line of Markdown that shows every character: `<class 'float'>` is not an HTML element,
    `__init__` is not bold."""
    return _MARKUP.sub(_escaped, " ".join(text.splitlines()))


def _escaped(found: re.Match[str]) -> str:
    text = found[0]
    if text[0] == "`":
        return text
    return "&lt;" if text == "<" else "".join("\\" + character for character in text)
