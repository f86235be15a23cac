"""Stores the text that a reviewer saw when deciding on a group, and compares it with the current text.

Each text begins with the digests of its decision, so that a text for another decision is ignored.
"""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from difflib import unified_diff
from pathlib import Path

from mutator._common.confined_files import read_below, write_below
from mutator.errors import MutatorError
from mutator.review.entries import Bound, Values, values_in_words

_AROUND = 3  # unchanged lines around a change
_HUNK = re.compile(r"@@ -\S+ \+(\d+)\S* @@")


def text_of(bound: Bound, values: Values, sections: Mapping[str, str]) -> str:
    """Return the stored text of a group: its digests, its values, then each section under its name."""
    parts = {"values": values_in_words(values), **sections}
    named = (f"== {name} ==\n{text}" + "\n" * (not text.endswith("\n")) for name, text in parts.items())
    return f"{_head(bound)}\n" + "\n".join(named)


def keep(library: Path, name: str, text: str) -> None:
    """Write the text that a reviewer saw, replacing earlier text."""
    write_below(library, name, text.encode("utf-8", "surrogateescape"))


def changes(library: Path, name: str, bound: Bound, text: str) -> str:
    """Return a unified diff from the stored text to the current `text`; empty if no text was stored for the
    decision with the digests `bound`.
    """
    try:
        before = read_below(library, name).decode("utf-8", "surrogateescape")
    except (OSError, MutatorError):
        return ""
    if not before.startswith(f"{_head(bound)}\n"):
        return ""
    old, new = (one.partition("\n")[2].splitlines(keepends=True) for one in (before, text))
    return "".join(_headed(unified_diff(old, new, "as decided", "now", n=_AROUND), new))


def _headed(diff: Iterable[str], new: Sequence[str]) -> Iterator[str]:
    """Yield the diff, with the hunk's section after each `@@` line, such as `calls: car/lens.py Light`."""
    for line in diff:
        hunk = _HUNK.match(line)
        yield f"{hunk[0]} {_section(new[: int(hunk[1]) - 1 + _AROUND])}\n" if hunk else line


def _section(lines: Iterable[str]) -> str:
    """Return the names of the last section in these lines and of its last part."""
    section = part = ""
    for line in lines:
        if line.startswith("== "):
            section, part = line.strip("= \n"), ""
        elif line.startswith("-- ") and section != "diff":
            part = line.removeprefix("-- ").strip()
    return ": ".join(filter(None, (section, part)))


def _head(bound: Bound) -> str:
    return f"# diff {bound.diff} function {bound.function} template {bound.template} calls {bound.calls}"
