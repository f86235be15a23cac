"""Text for users: counts, values in errors, suggestions."""

import difflib
import re
import textwrap
from collections.abc import Collection, Iterable
from typing import Any

SHORT_ID_LENGTH = 8  # characters of an id for people, or as many as make it unique
_MOST_LISTED_SEEDS = 10  # of more, the number and the ends


def counted(count: int, noun: str, plural: str = "") -> str:
    """Return a count with its noun: 1 run, 2 runs. Give irregular plurals."""
    return f"{count} {noun}" if count == 1 else f"{count} {plural or noun + 's'}"


def rounded_percent(part: float, whole: float) -> str:
    """Return a share as a whole percent. Only none is 0 and only all is 100: 1 of 300 is `under 1`."""
    percent = 100 * part / whole
    if 0 < percent <= 0.5:
        return "under 1"
    return "over 99" if 99.5 <= percent < 100 else f"{percent:.0f}"


def shortened_ids(ids: Iterable[str]) -> list[str]:
    """Return ids with eight characters, or as many as make them different."""
    names = list(ids)
    length = short_id_length(names)
    return [name[:length] for name in names]


def short_id_length(ids: Collection[str]) -> int | None:
    """Return how many characters tell ids apart, at least eight; None: all of them are needed."""
    names = set(ids)
    lengths = range(SHORT_ID_LENGTH, max(map(len, names), default=0))
    return next((n for n in lengths if len({name[:n] for name in names}) == len(names)), None)


def describe_choices(names: Iterable[str]) -> str:
    """Return what is expected of a name that must be one of these."""
    listed = ", ".join(names)
    return f"one of {listed}" if listed else "a known name, but there is none"


def shortened_repr(value: Any) -> str:
    """Return a value as errors show it: at most 60 characters; text is quoted, numbers are not."""
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return str(value).lower()
    text = repr(value)
    # with place, expectation and remedy around it, a longer value would bury them
    return text if len(text) <= 60 else text[:57] + "..."


def spelling_suggestion(word: str, choices: list[str]) -> str:
    """Return `; did you mean 'x'?` if one of `choices` is close to `word`, else an empty text."""
    close = difflib.get_close_matches(word, choices, n=1)
    return f"; did you mean '{close[0]}'?" if close else ""


_PYTHON_OPERATOR_BY_FOREIGN_OPERATOR = {"&&": "and", "||": "or", "!": "not", "=": "=="}
_FOREIGN_OPERATOR_PATTERN = re.compile(r"&&|\|\||!(?!=)|(?<![<>=!])=(?!=)")
_QUOTED_TEXT_PATTERN = re.compile(r"\"[^\"]*\"|'[^']*'")


def python_operator_hint(text: str) -> str:
    """Return which Python operators to write for those of other languages, such as `&&`; '' without any."""
    operators = dict.fromkeys(_FOREIGN_OPERATOR_PATTERN.findall(_QUOTED_TEXT_PATTERN.sub("", text)))
    return ", ".join(
        f"write '{_PYTHON_OPERATOR_BY_FOREIGN_OPERATOR[operator]}' for '{operator}'" for operator in operators
    )


NO_BREAK_SPACE = "\u00a0"  # in a terminal, printed as a space at which text is not folded
_SPACE_BEFORE_UNIT_PATTERN = re.compile(
    r"(?<=\d) (?!(?:and|in|of|or|to) )(?=[A-Za-z%°][\w/^²]{0,4}(?![\w/]))"
)

_SPACED_COMPARISON_PATTERN = re.compile(r" ([<>]=?|[=!]=) ")  # `hwt <= 2.0`


def with_unbreakable_numbers(text: str) -> str:
    """Return the text with spaces that no line may be folded at between a number and a short word, which can
    be its unit. For texts of pages: what users copy into files or a shell keeps its spaces.
    """
    return _SPACE_BEFORE_UNIT_PATTERN.sub(NO_BREAK_SPACE, text)


def with_unbreakable_units(text: str) -> str:
    """Return the text with spaces that no line may be folded at: between a number and a short word, which can
    be its unit, around the sign of a comparison, and in commands in backticks.
    """
    text = with_unbreakable_numbers(text)
    text = _SPACED_COMPARISON_PATTERN.sub(NO_BREAK_SPACE + r"\1" + NO_BREAK_SPACE, text)
    return _COMMAND_IN_BACKTICKS_PATTERN.sub(lambda command: command[0].replace(" ", NO_BREAK_SPACE), text)


def unbreakable_parts(text: str) -> list[str]:
    """Return the parts of a text between which a line can be folded."""
    return re.split(r"[ \n]", with_unbreakable_units(text))


_NAME_BEFORE_VALUE_PATTERN = re.compile(r"[^\s:]+(?: [^\s:]+)*  +")  # `name   ` before a value
_COMMAND_IN_BACKTICKS_PATTERN = re.compile(r"`[^`]*`")
_DIGEST_LINE_PATTERN = re.compile(r"[\w .-]{1,40}:? +[0-9a-f]{64}")  # `seal: 3f9a...`, to copy
_UNBREAKABLE_SPACE = "\0"  # no message contains it, and textwrap does not break lines there


def wrap_text(text: str, width: int) -> str:
    """Break lines between words to at most `width` characters. Longer words and commands in backticks stay
    whole.

    A line with only a name and a digest is left as it is. Continuation lines are indented; in a line
    `name  value`, they align with the value.
    """
    return "\n".join(_wrap_line(line, width) if len(line) > width else line for line in text.split("\n"))


def _wrap_line(line: str, width: int) -> str:
    if line.startswith("|") or _DIGEST_LINE_PATTERN.fullmatch(line):  # a row of a Markdown table; a digest
        return line
    start = _NAME_BEFORE_VALUE_PATTERN.match(line)
    # values far to the right would leave too little room for their lines
    indent = len(start[0]) if start and len(start[0]) <= width // 2 else _indentation(line) + 2
    unbroken = _COMMAND_IN_BACKTICKS_PATTERN.sub(
        lambda command: command[0].replace(" ", _UNBREAKABLE_SPACE), line
    )
    if indent + max(map(len, unbroken.split(" "))) > width:  # e.g. a digest in a narrow terminal
        indent = _indentation(line) + 2
    lines = textwrap.wrap(
        unbroken,
        max(width, indent + 1),
        subsequent_indent=" " * indent,
        break_long_words=False,
        break_on_hyphens=False,
        expand_tabs=False,
        replace_whitespace=False,
    )
    return "\n".join(lines).replace(_UNBREAKABLE_SPACE, " ")


def _indentation(line: str) -> int:
    return len(line) - len(line.lstrip())


def describe_seeds(seeds: range) -> str:
    return f"seed {seeds[0]}" if len(seeds) == 1 else f"seeds {seeds[0]} to {seeds[-1]}"


def list_seeds(seeds: Iterable[int]) -> str:
    """Return the different seeds of experiments that were asked for one by one: `0, 3, 7`."""
    ordered = sorted(set(seeds))
    if len(ordered) > _MOST_LISTED_SEEDS:
        return f"{len(ordered)} seeds from {ordered[0]} to {ordered[-1]}"
    return ", ".join(map(str, ordered))
