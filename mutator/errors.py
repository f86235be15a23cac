"""Every exception of the harness, with when it is raised and what to do, and the exit codes of all commands.

    MutatorError            the user can fix it
      CheckFailed           a check says no; exit code 1
        ReviewConflict
      Shortage, DiskFull    the machine's limits; exit code 3
      Outside, TooLarge     files of others that must not be read
      InvalidMutant, BadOutput
      JobEnded, GroupsChanged, Absent, UnknownPage    the server refuses a request
    MutatorWarning, IncompleteRun
    Signal                  caught by the harness itself; users see what it makes of it

Code in a target's process has its exceptions beside it, because it cannot import this module.
"""

from pathlib import Path
from typing import Any

_LONGEST = 2000  # longest part of an error, in characters
EXIT_OK = 0
EXIT_CHECK_FAILED = 1
EXIT_WRONG_INPUT = 2
EXIT_HARNESS_ERRORS = 3


class MutatorError(Exception):
    """An error that the user can fix, shown without a traceback. Do what `remedy` says.

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
    """A warning for the user, shown in one line. The command goes on; correct what it names."""


def _short(text: str) -> str:
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]}..."


def _rebuild(cls: type[MutatorError], got: str, state: dict[str, Any]) -> MutatorError:
    return cls(got, **state)


class CheckFailed(MutatorError):
    """A check failed: a campaign cannot start, its results are invalid, or a comparison failed a gate. Read
    what the check found; the command ran as asked.
    """

    exit_code = EXIT_CHECK_FAILED  #: exit code of a command that ends with this error


class ReviewConflict(CheckFailed):
    """Somebody else changed the review of these groups after the caller read it. Nothing was written: read
    the review again, then decide again.

    `groups` are their ids, `review` is the current `mutator.review.decisions.Review`.
    """

    groups: tuple[str, ...] = ()
    review: Any


class Shortage(MutatorError):
    """The machine is out of a resource, or this process has reached a limit. Finished work is kept: raise the
    limit, then run the same command again.
    """

    exit_code = EXIT_HARNESS_ERRORS


class DiskFull(MutatorError):
    """No space left on the disk. Finished work is kept: free space, then run the same command again."""

    exit_code = EXIT_HARNESS_ERRORS


class Outside(MutatorError):
    """A name points out of its folder, or something in a folder is not a plain file or folder. Do not use
    the folder, unless you know who made it so.
    """


class TooLarge(MutatorError, ValueError):
    """A file is larger than anything that belongs there: restore it.

    Also a ValueError, so that readers that skip a damaged file (of a cache) skip it as well.
    """


class InvalidMutant(MutatorError):
    """The mutated file does not compile. Such a mutant is never run: correct the spec or the template."""


class BadOutput(MutatorError):
    """A run finished, but its trace or record is missing or does not match the manifest. Correct the
    manifest, or the code that records the run.
    """


class JobEnded(MutatorError):
    """The server's job has already ended and cannot be cancelled: read its result."""


class GroupsChanged(MutatorError):
    """The groups of a review have changed since the page was loaded. The page loads them again: `groups`."""

    def __init__(self, got: str, groups: dict[str, Any]) -> None:
        super().__init__(got)
        self.groups = groups


class Absent(MutatorError):
    """What a request names does not exist or is not served: begin at the server's first page."""


class UnknownPage(MutatorError):
    """A request comes from a page that may not send it, or from a page of an earlier server: reload it."""


class IncompleteRun(UserWarning):
    """Warning: a run ended with unfinished experiments or harness errors. Run the campaign again."""


class Signal(Exception):
    """What the harness raises for itself and always catches. What to do stands at each."""


class BadTrace(Signal, ValueError):
    """An invalid trace file: what was found, and what was expected. The reader of the run's output reports
    it as a BadOutput with the file's path.
    """

    def __init__(self, got: str, expected: str) -> None:
        super().__init__(got)
        self.got, self.expected = got, expected


class ForkServerLost(Signal):
    """A process of the fork server is gone or does not answer. The engine starts another server."""


class NotForkable(Signal):
    """A target or run that cannot be forked. The text says why; `remedy` says what to do, if known. The
    reference engine runs it.
    """

    def __init__(self, why: str, remedy: str = "") -> None:
        super().__init__(why, remedy)
        self.remedy = remedy

    def __str__(self) -> str:
        return str(self.args[0])


class NotSwappable(Signal):
    """The mutant cannot be put into a running program; the text says why. The reference engine runs it."""


class NotTestable(Signal):
    """A comparison that does not compare one variable with a constant. Coverage is then not measured."""


class HarnessErrors(Signal):
    """The harness could not judge some experiments of a chunk. The pytest item fails with this text."""


class PieceNotWanted(Signal):
    """The command no longer waits for this piece of work. The worker drops it."""


class GoldenRunsDiffer(Signal):
    """A golden run made on a worker differs from the campaign's. The worker gets no work."""


class WorkerRefused(Signal):
    """A worker gets no work, or no more work. Others do it."""


class WorkerCutOff(WorkerRefused):
    """The scheduler briefly lost its connection to the command, and dropped all tasks. Admit the worker
    again.
    """


class SchedulerGone(Signal):
    """The scheduler no longer answers. The session ends; the same command resumes it."""
