"""Errors that a user can fix."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


class ConfigError(Exception):
    """Invalid input. The message reads `file:line: GOT, expected EXPECTED; REMEDY`."""

    def __init__(
        self, got: str, *, where: str = "", line: int | None = None, expected: str, remedy: str
    ) -> None:
        place = f"{where}:{line}: " if line is not None else f"{where}: " if where else ""
        super().__init__(f"{place}{got}, expected {expected}; {remedy}")


@contextmanager
def writing(where: Path, *, expected: str, remedy: str) -> Iterator[None]:
    """Turn file system errors in the `with` block into a ConfigError that names `where`."""
    try:
        yield
    except OSError as error:
        got = error.strerror or str(error)
        raise ConfigError(got, where=str(where), expected=expected, remedy=remedy) from None
