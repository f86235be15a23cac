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

EVENTS_FD_VARIABLE = "MUTATOR_EVENTS_FD"
SMALLEST_FORM_LINK = "smallest form"  # the kind of a link to a run folder and an experiment in it
MOST_EVENT_TEXT_LENGTH = 500  # characters; so that a line is written in one piece (PIPE_BUF)
_events_pipe_descriptor: int | None = None


def open_events_pipe() -> None:
    """Use the pipe named by the environment, and hide it from child processes, which may run mutants.

    MutatorError if the variable does not name an open pipe.
    """
    global _events_pipe_descriptor
    text = os.environ.pop(EVENTS_FD_VARIABLE, None)
    if text is None:
        return
    try:
        fd = int(text)
        if not stat.S_ISFIFO(os.fstat(fd).st_mode):
            raise ValueError
        os.set_inheritable(fd, False)
    except (ValueError, OverflowError, OSError):
        raise MutatorError(
            f"'{text}'", where=EVENTS_FD_VARIABLE, expected="the number of an open pipe", remedy="unset it"
        ) from None
    _events_pipe_descriptor = fd


def report_phase(
    name: str, finished: int = 0, total: int = 0, outcomes: Mapping[str, int] | None = None
) -> None:
    """Report what the command is doing: `finished` of `total` steps (0: nothing to count)."""
    _send_event(
        "phase",
        phase=name[:MOST_EVENT_TEXT_LENGTH],
        done=finished,
        total=total,
        outcomes=dict(outcomes or {}),
    )


def report_warning(text: str) -> None:
    _send_event("warning", text=text[:MOST_EVENT_TEXT_LENGTH])


def report_written_file(kind: str, path: Path) -> None:
    """Report a written file, such as a plot."""
    _send_event("link", kind=kind, path=str(path.absolute()))


def report_result(text: str) -> None:
    """Report what came out, in one sentence. The last result counts."""
    _send_event("result", text=text[:MOST_EVENT_TEXT_LENGTH])


def report_error(text: str) -> None:
    _send_event("error", text=text[:MOST_EVENT_TEXT_LENGTH])


def _send_event(event: str, **facts: object) -> None:
    global _events_pipe_descriptor
    if _events_pipe_descriptor is None:
        return
    line = json.dumps({"event": event, **facts}, ensure_ascii=False) + "\n"
    try:
        os.write(_events_pipe_descriptor, line.encode("utf-8", "replace"))
    except OSError:  # nobody reads any more
        _events_pipe_descriptor = None
