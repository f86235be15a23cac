"""Every exception of the harness, with when it is raised and what to do, and the exit codes of all commands.

    MutatorError            the user can fix it
      CheckFailed           a check says no; exit code 1
        ReviewConflict
      ResourceShortage, DiskFull  the machine's limits; exit code 3
      UnsafePath, TooLarge  files of others that must not be read
      InvalidMutant, BadOutput, BadAddition
      JobAlreadyEnded, GroupsChanged, NotServed, RequestFromWrongPage    the server refuses a request
    MutatorWarning, IncompleteRun
    InternalException       caught by the harness itself; users see what it makes of it

Each docstring has a line on each (`When:`, `To do:`). The page of the Python API shows those of public ones.
Code in a target's process has its exceptions beside it, because it cannot import this module.
"""

from pathlib import Path
from typing import Any

_MOST_PART_LENGTH = 2000  # characters of a part of an error; a value from a file can be megabytes
EXIT_OK = 0
EXIT_CHECK_FAILED = 1
EXIT_WRONG_INPUT = 2
EXIT_HARNESS_ERRORS = 3


class MutatorError(Exception):
    """An error that the user can fix, shown without a traceback.

    * When: an argument, a file, a folder or the target is not as a command or a function needs it.
    * To do: what `remedy` says. Names in backquotes in it are arguments of the API; the command line shows
      the matching options.
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
        self.got = _shorten(got)  #: what was found
        self.where = str(where) if where is not None else None  #: the file with the error
        self.line = line  #: the number of the line with the error
        self.argument = argument  #: the name of the wrong argument, if the error is not in a file
        self.expected = _shorten(expected) if expected else None  #: what is valid
        self.remedy = _shorten(remedy) if remedy else None  #: what to do
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
        return _rebuild_error, (type(self), self.got, state)


class MutatorWarning(UserWarning):
    """A warning for the user, shown in one line.

    * When: a command goes on although something is probably not as intended.
    * To do: correct what the warning names, unless it is intended.
    """


def _shorten(text: str) -> str:
    return text if len(text) <= _MOST_PART_LENGTH else f"{text[:_MOST_PART_LENGTH]}..."


def _rebuild_error(cls: type[MutatorError], got: str, state: dict[str, Any]) -> MutatorError:
    return cls(got, **state)


class CheckFailed(MutatorError):
    """A check says no. The command ran as asked.

    * When: a campaign cannot start, its results are invalid, or a comparison fails a gate.
    * To do: read what the check found, and correct that.
    """

    exit_code = EXIT_CHECK_FAILED  #: exit code of a command that ends with this error


class ReviewConflict(CheckFailed):
    """Somebody else changed the review. Nothing was written.

    * When: another review of these groups was stored after the caller had read it.
    * To do: read the review again, then decide again.

    `groups` are their ids, `review` is the current `mutator.review.review_state_and_actions.Review`.
    """

    groups: tuple[str, ...] = ()
    review: Any


class ResourceShortage(MutatorError):
    """The machine is out of a resource. Finished work is kept.

    * When: memory, processes or open files are used up, or this process has reached its limit of them.
    * To do: raise the limit, then run the same command again.
    """

    exit_code = EXIT_HARNESS_ERRORS


class DiskFull(MutatorError):
    """No space is left on the disk. Finished work is kept.

    * When: a file cannot be written for lack of space.
    * To do: free space, then run the same command again.
    """

    exit_code = EXIT_HARNESS_ERRORS


class UnsafePath(MutatorError):
    """A folder is not safe to read.

    * When: a name points out of its folder, or something in the folder is a link, a pipe or a device.
    * To do: do not use the folder, unless you know who made it so.
    """


class TooLarge(MutatorError, ValueError):
    """A file is larger than anything that belongs there.

    * When: a file has more bytes than its reader allows.
    * To do: restore the file.

    Also a ValueError, so that readers that skip a damaged file (of a cache) skip it as well.
    """


class InvalidMutant(MutatorError):
    """A mutant is never run because its file is not valid Python.

    * When: the mutated file does not compile.
    * To do: correct the spec or the template.
    """


class BadOutput(MutatorError):
    """A run finished without usable output.

    * When: its trace or record is missing or does not match the manifest.
    * To do: correct the manifest, or the code that records the run.
    """


class BadAddition(MutatorError):
    """What another package adds to mutator fails.

    * When: an operator, export, importer, distributor or study of an installed package raises an exception.
    * To do: correct the package, update it or uninstall it.
    """


class JobAlreadyEnded(MutatorError):
    """A job of the server cannot be cancelled.

    * When: it has already ended.
    * To do: read its result.
    """


class GroupsChanged(MutatorError):
    """A decision of the review page is refused.

    * When: the groups have changed since the page was loaded.
    * To do: show the current `groups`, then decide again.
    """

    def __init__(self, got: str, groups: dict[str, Any]) -> None:
        super().__init__(got)
        self.groups = groups


class NotServed(MutatorError):
    """A request to the server names something that it does not serve.

    * When: no such run, job, group, target or file exists.
    * To do: begin at the server's first page.
    """


class RequestFromWrongPage(MutatorError):
    """A request to the server is refused.

    * When: it comes from a page that may not send it, or from a page of an earlier server.
    * To do: reload the page.
    """


class IncompleteRun(UserWarning):
    """A warning: a run is incomplete.

    * When: it ended with unfinished experiments or harness errors.
    * To do: run the campaign again.
    """


class InternalException(Exception):
    """What the harness raises for itself; users see what the catcher makes of it.

    * When: a function cannot do its part, and its caller has another way.
    * To do: catch it.
    """


class BadTrace(InternalException, ValueError):
    """A trace file is invalid.

    * When: its bytes are not what its format prescribes, or its format cannot be read here.
    * To do: report it as a BadOutput with the file's path.
    """

    def __init__(self, got: str, expected: str) -> None:
        super().__init__(got)
        self.got, self.expected = got, expected


class TypeMisfit(InternalException, ValueError):
    """A value of a file does not fit its type. `path` leads to it, from the outermost key.

    * When: a record is read from JSON that has another type there, or a key too few or too many.
    * To do: report it as a MutatorError with the file's path.
    """

    def __init__(self, got: str, expected: str | None = None) -> None:
        super().__init__(got)
        self.got, self.expected = got, expected
        self.path: list[str | int] = []


class ForkServerLost(InternalException):
    """The fork server cannot be used any more.

    * When: one of its processes is gone, does not answer, or does not have the pristine tree.
    * To do: start another server.
    """


class NotForkable(InternalException):
    """A target or run that cannot be forked. The text says why; `remedy` is for the user, if known.

    * When: the target is not stepwise, cannot be loaded or driven, or has threads.
    * To do: run it on the reference engine.
    """

    def __init__(self, why: str, remedy: str = "") -> None:
        super().__init__(why, remedy)
        self.remedy = remedy

    def __str__(self) -> str:
        return str(self.args[0])


class MutantNotSwappable(InternalException):
    """A mutant that cannot be put into a running program. The text says why.

    * When: it changes more than functions, or a line that does not ask the probe first.
    * To do: run it on the reference engine.
    """


class BoundaryNotTestable(InternalException):
    """A comparison whose boundary cannot be tested.

    * When: it does not compare one variable with a constant.
    * To do: report that coverage is not measured.
    """


class PytestItemFailed(InternalException):
    """The work of a pytest item failed.

    * When: the harness could not judge some of its experiments, or the session met a problem.
    * To do: fail the item with this text.
    """


class PieceNoLongerNeeded(InternalException):
    """A piece of work is no longer needed.

    * When: the command no longer waits for it.
    * To do: have the worker drop it.
    """


class WorkerGoldenRunsDiffer(InternalException):
    """A worker computes something else than the machine of the command.

    * When: a golden run made on the worker differs from the campaign's.
    * To do: give the worker no work.
    """


class WorkerRefused(InternalException):
    """A worker gets no work, or no more work.

    * When: its calls fail, it differs from the command's machine, or it left the run.
    * To do: give its work to others.
    """


class WorkerCutOff(WorkerRefused):
    """The scheduler dropped all tasks of a worker.

    * When: it briefly lost its connection to the command.
    * To do: admit the worker again.
    """


class SchedulerGone(InternalException):
    """A session on a cluster cannot go on.

    * When: the scheduler no longer answers.
    * To do: end the session; the same command resumes it.
    """
