"""Errors that users can fix, and the exit codes of all commands."""

from pathlib import Path
from typing import Any

_LONGEST = 2000  # longest part of an error, in characters
EXIT_OK = 0
EXIT_CHECK_FAILED = 1
EXIT_WRONG_INPUT = 2
EXIT_HARNESS_ERRORS = 3


class MutatorError(Exception):
    """An error that the user can fix, shown without a traceback.

    Names in backquotes in the remedy are arguments of the API; the command line shows the matching options.
    """

    exit_code = EXIT_WRONG_INPUT  #: exit code of a command that ends with this error

    def __init__(
        self,
        got: str,
        *,
        where: str | Path | None = None,
        line: int | None = None,
        argument: str | None = None,
        expected: str | None = None,
        remedy: str | None = None,
    ) -> None:
        self.got = _short(got)  #: what was found
        self.where = str(where) if where is not None else None  #: the file with the error
        self.line = line  #: the number of the line with the error
        self.argument = argument  #: the name of the wrong argument, if the error is not in a file
        self.expected = _short(expected) if expected else None  #: what is valid
        self.remedy = _short(remedy) if remedy else None  #: what to do
        super().__init__(str(self))

    def __str__(self) -> str:
        place = self.where or self.argument or ""
        if self.where and self.line is not None:
            place += f":{self.line}"
        parts = [self.got]
        if self.expected:
            parts.append(f"expected {self.expected}")
        if self.remedy:
            parts.append(self.remedy)
        text = "; ".join(parts)
        return f"{place}: {text}" if place else text

    def __reduce__(self) -> tuple[object, ...]:
        state = {
            "where": self.where,
            "line": self.line,
            "argument": self.argument,
            "expected": self.expected,
            "remedy": self.remedy,
        }
        return _rebuild, (type(self), self.got, state)


class MutatorWarning(UserWarning):
    """A warning for the user, shown in one line."""


def _short(text: str) -> str:
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]}..."


def _rebuild(cls: type[MutatorError], got: str, state: dict[str, Any]) -> MutatorError:
    return cls(got, **state)


class CheckFailed(MutatorError):
    """A check failed: a campaign cannot start, its results are invalid, or a comparison failed a gate."""

    exit_code = EXIT_CHECK_FAILED  #: exit code of a command that ends with this error
