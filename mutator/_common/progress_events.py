"""Report a command's progress and result to the program that started it, one JSON object a line.

The command inherits the writing end of a pipe, whose descriptor is in `MUTATOR_EVENTS_FD`. Without it, events
are dropped. What the command prints for people does not depend on events.
"""

import json
import os
import stat
from collections.abc import Mapping
from pathlib import Path

from mutator.errors import MutatorError

EVENTS_FD = "MUTATOR_EVENTS_FD"
LONGEST_TEXT = 500  # characters; so that a line is written in one piece (PIPE_BUF)
_pipe: int | None = None


def open_events() -> None:
    """Use the pipe named by the environment, and hide it from child processes, which may run mutants.

    MutatorError if the variable does not name an open pipe.
    """
    global _pipe
    text = os.environ.pop(EVENTS_FD, None)
    if text is None:
        return
    try:
        fd = int(text)
        if not stat.S_ISFIFO(os.fstat(fd).st_mode):
            raise ValueError
        os.set_inheritable(fd, False)
    except (ValueError, OverflowError, OSError):
        raise MutatorError(
            f"'{text}'", where=EVENTS_FD, expected="the number of an open pipe", remedy="unset it"
        ) from None
    _pipe = fd


def phase(name: str, done: int = 0, total: int = 0, outcomes: Mapping[str, int] | None = None) -> None:
    """Report what the command is doing: `done` of `total` steps (0: nothing to count)."""
    _send("phase", phase=name[:LONGEST_TEXT], done=done, total=total, outcomes=dict(outcomes or {}))


def warning(text: str) -> None:
    _send("warning", text=text[:LONGEST_TEXT])


def link(kind: str, path: Path) -> None:
    """Report a written file, such as a plot."""
    _send("link", kind=kind, path=str(path.absolute()))


def result(text: str) -> None:
    """Report what came out, in one sentence. The last result counts."""
    _send("result", text=text[:LONGEST_TEXT])


def error(text: str) -> None:
    _send("error", text=text[:LONGEST_TEXT])


def _send(event: str, **facts: object) -> None:
    global _pipe
    if _pipe is None:
        return
    line = json.dumps({"event": event, **facts}, ensure_ascii=False) + "\n"
    try:
        os.write(_pipe, line.encode("utf-8", "replace"))
    except OSError:  # nobody reads any more
        _pipe = None
