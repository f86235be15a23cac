"""HTML fragments for notebooks."""

from collections.abc import Iterable
from html import escape

from mutator._common.table_rendering import TextTable

_COLOUR_BY_SIGN = {"+": "#116329", "-": "#a40e26", "@": "#0550ae"}


def facts_html(facts: Iterable[tuple[str, object]]) -> str:
    """Return a table of names and values, without the values that are None."""
    rows = [[name, str(value)] for name, value in facts if value is not None]
    return str(TextTable(heads=("", ""), rows=rows).as_html())


def text_html(text: str) -> str:
    return f"<p>{escape(text)}</p>"


def diff_html(patch: str) -> str:
    return f"<pre>{''.join(map(_diff_line_html, patch.splitlines()))}</pre>"


def _diff_line_html(line: str) -> str:
    colour = None if line.startswith(("+++", "---")) else _COLOUR_BY_SIGN.get(line[:1])
    text = escape(line) + "\n"
    return f'<span style="color:{colour}">{text}</span>' if colour else text
