"""Errors a user can mend, and the exit codes of every command."""

from pathlib import Path
from typing import Any

_LONGEST = 2000  # characters of a part of an error
EXIT_OK = 0
EXIT_CHECK_FAILED = 1
EXIT_WRONG_INPUT = 2
EXIT_HARNESS_ERRORS = 3


class MutatorError(Exception):
    """Something the user can mend: shown in one piece, without a traceback.

    `where` is the file at fault, `line` its line when known; `got` what was found there and `expected` what
    would be right; `remedy` what to do. `argument` names the argument of the API at fault instead of a file;
    in the remedy of such an error `names` in backquotes are arguments, too. The command line shows the
    options that they stand for.
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
        self.where = str(where) if where is not None else None  #: the file at fault
        self.line = line  #: its line
        self.argument = argument  #: the argument at fault, where no file is
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
    """Something that the user should know although nothing failed: shown in one line."""


def _short(text: str) -> str:
    """The text, cut where nobody reads on: what is wrong may be megabytes long."""
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]}..."


def _rebuild(cls: type[MutatorError], got: str, state: dict[str, Any]) -> MutatorError:
    return cls(got, **state)


class CheckFailed(MutatorError):
    """A check said no: the campaign does not start, or a comparison is beyond its bounds."""

    exit_code = EXIT_CHECK_FAILED  #: exit code of a command that ends with this error
