"""Stores the text that a reviewer saw when deciding on a group, and compares it with the current text.

Each text begins with the digests of its decision, so that a text for another decision is ignored.
"""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from difflib import unified_diff
from pathlib import Path

from mutator._common.confined_files import read_below, write_below
from mutator.errors import MutatorError
from mutator.review.review_entries import BasisDigests, ValueRanges, describe_ranges

_CONTEXT_LINES = 3  # unchanged lines around a change
_HUNK_PATTERN = re.compile(r"@@ -\S+ \+(\d+)\S* @@")


def render_reviewed_text(digests: BasisDigests, values: ValueRanges, sections: Mapping[str, str]) -> str:
    """Return the stored text of a group: its digests, its values, then each section under its name."""
    parts = {"values": describe_ranges(values), **sections}
    named = (f"== {name} ==\n{text}" + "\n" * (not text.endswith("\n")) for name, text in parts.items())
    return f"{_digest_line(digests)}\n" + "\n".join(named)


def write_reviewed_text(library: Path, name: str, text: str) -> None:
    """Write the text that a reviewer saw, replacing earlier text."""
    # the source of a target need not be UTF-8
    write_below(library, name, text.encode("utf-8", "surrogateescape"))


def diff_from_reviewed_text(library: Path, name: str, digests: BasisDigests, text: str) -> str:
    """Return a unified diff from the stored text to the current `text`; empty if no text was stored for the
    decision with these digests.
    """
    try:
        before = read_below(library, name).decode("utf-8", "surrogateescape")
    except (OSError, MutatorError):
        return ""
    if not before.startswith(f"{_digest_line(digests)}\n"):
        return ""
    old, new = (version.partition("\n")[2].splitlines(keepends=True) for version in (before, text))
    return "".join(_with_section_names(unified_diff(old, new, "as decided", "now", n=_CONTEXT_LINES), new))


def _with_section_names(diff: Iterable[str], new: Sequence[str]) -> Iterator[str]:
    """Yield the diff, with the hunk's section after each `@@` line, such as `calls: car/lens.py Light`."""
    for line in diff:
        hunk = _HUNK_PATTERN.match(line)
        yield f"{hunk[0]} {_last_section_name(new[: int(hunk[1]) - 1 + _CONTEXT_LINES])}\n" if hunk else line


def _last_section_name(lines: Iterable[str]) -> str:
    """Return the names of the last section in these lines and of its last part."""
    section = part = ""
    for line in lines:
        if line.startswith("== "):
            section, part = line.strip("= \n"), ""
        elif line.startswith("-- ") and section != "diff":
            part = line.removeprefix("-- ").strip()
    return ": ".join(filter(None, (section, part)))


def _digest_line(digests: BasisDigests) -> str:
    return (
        f"# diff {digests.diff} function {digests.function} template {digests.template} calls {digests.calls}"
    )
