"""A parsed file, with the line of every value for error messages."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mutator.errors import MutatorError

KeyPath = tuple[str | int, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class YamlSource:
    """A parsed file. `lines` maps a path of keys to its line (from 1)."""

    path: Path
    data: Any
    lines: dict[KeyPath, int]

    def line_of(self, keys: KeyPath) -> int | None:
        """Return the line of the value at `keys`, or of the nearest enclosing value."""
        for end in range(len(keys), -1, -1):
            if keys[:end] in self.lines:
                return self.lines[keys[:end]]
        return None

    def error(
        self, keys: KeyPath, got: str, *, expected: str | None = None, remedy: str | None = None
    ) -> MutatorError:
        """Return an error that points at the value at `keys`."""
        return MutatorError(got, where=self.path, line=self.line_of(keys), expected=expected, remedy=remedy)

    @contextmanager
    def locating_errors(self, keys: KeyPath) -> Iterator[None]:
        """Make every MutatorError raised in the block point at the value at `keys`."""
        try:
            yield
        except MutatorError as error:
            raise self.error(keys, error.got, expected=error.expected, remedy=error.remedy) from None
