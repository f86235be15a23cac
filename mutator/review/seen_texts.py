"""What a reviewer saw when a group was decided, kept as plain text, and how it differs from now.

A text begins with the digests it stands for, so one that does not belong to the decision explains nothing.
"""

from collections.abc import Mapping
from difflib import unified_diff
from pathlib import Path

from mutator._common.files import make_folder, no_pipe, write_atomic
from mutator.review.entries import Bound, Values, values_in_words

_AROUND = 3  # unchanged lines around a change


def text_of(bound: Bound, values: Values, sections: Mapping[str, str]) -> str:
    """What is kept of a group: its digests, its values, then each section under its name."""
    parts = {"values": values_in_words(values), **sections}
    named = (f"== {name} ==\n{text}" + "\n" * (not text.endswith("\n")) for name, text in parts.items())
    return f"{_head(bound)}\n" + "\n".join(named)


def keep(path: Path, text: str) -> None:
    """Write what was seen, in the place of what was seen before."""
    make_folder(path.parent)
    write_atomic(path, text.encode("utf-8", "surrogateescape"))


def changes(path: Path, bound: Bound, text: str) -> str:
    """What was seen when `bound` was decided about against `text`, that of now, as a unified diff.

    Empty where nothing was kept, or not what this decision is about.
    """
    try:
        before = no_pipe(path).read_bytes().decode("utf-8", "surrogateescape")
    except OSError:
        return ""
    if not before.startswith(f"{_head(bound)}\n"):
        return ""
    old, new = (one.partition("\n")[2].splitlines(keepends=True) for one in (before, text))
    return "".join(unified_diff(old, new, "as decided", "now", n=_AROUND))


def _head(bound: Bound) -> str:
    return f"# diff {bound.diff} function {bound.function} template {bound.template} calls {bound.calls}"
