"""Finds the places of a generated library that its owner must still fill in."""

from collections.abc import Iterator
from pathlib import Path

from mutator._common.bounded_reading import read_bounded
from mutator._common.confined_files import files_inside
from mutator.config.yaml_files import MOST_YAML_BYTES
from mutator.errors import MutatorError

TODO_MARK = "TODO(init)"


def unfilled_mark_errors(library: Path) -> Iterator[MutatorError]:
    """Yield an error for each mark in the library's YAML and Python files, in file order."""
    for path in files_inside(library, "", "*"):
        if path.suffix not in (".yaml", ".py") or not path.is_file():
            continue
        lines = read_bounded(path, MOST_YAML_BYTES).decode(errors="replace").splitlines()
        for number, line in enumerate(lines, 1):
            _, mark, text = line.partition(f"# {TODO_MARK}:")
            if mark:
                yield MutatorError(
                    f"not filled in: {_join_comment_lines(text, lines[number:])}",
                    where=path,
                    line=number,
                    remedy=f"fill it in, and delete the comment with {TODO_MARK}",
                )


def _join_comment_lines(text: str, following: list[str]) -> str:
    """Join a comment with the comments on the lines directly below it."""
    words = [text.strip()]
    for line in map(str.strip, following):
        if not line.startswith("# ") or TODO_MARK in line:
            break
        words.append(line.removeprefix("# "))
    return " ".join(words)
