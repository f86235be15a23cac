"""Text for people: counted things, values in errors, suggestions."""

import difflib
import re
from typing import Any


def counted(count: int, noun: str, plural: str = "") -> str:
    """A number of things: 1 run, 2 runs; `plural` where it is not the noun and an s."""
    return f"{count} {noun}" if count == 1 else f"{count} {plural or noun + 's'}"


def shown(value: Any) -> str:
    """A value as an error shows it: at most 60 characters, text is quoted, numbers are not."""
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return str(value).lower()
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def suggestion(word: str, known: list[str]) -> str:
    """`, did you mean 'x'?` when one of `known` is close to `word`, else nothing."""
    close = difflib.get_close_matches(word, known, n=1)
    return f"; did you mean '{close[0]}'?" if close else ""


_OPERATORS = {"&&": "and", "||": "or", "!": "not", "=": "=="}
_WRONG = re.compile(r"&&|\|\||!(?!=)|(?<![<>=!])=(?!=)")
_QUOTED = re.compile(r"\"[^\"]*\"|'[^']*'")


def operator_hint(text: str) -> str:
    """What to write for the operators of other languages in an expression; empty if it has none."""
    found = dict.fromkeys(_WRONG.findall(_QUOTED.sub("", text)))
    return ", ".join(f"write '{_OPERATORS[one]}' for '{one}'" for one in found)
