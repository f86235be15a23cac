"""Errors of a machine that has run out of memory, open files or processes. A user can fix them."""

import errno
import os

from mutator.errors import ResourceShortage

_TOO_MANY_OPEN_FILES_ERRNOS = (errno.EMFILE, errno.ENFILE)
_NO_THREAD_MESSAGE = "can't start new thread"  # Python's RuntimeError has no number
# of an ImportError, when there is too little memory to load a library; it has no number either
_NO_MEMORY_TO_LOAD_MESSAGES = ("failed to map segment", "cannot allocate memory")
_RUN_AGAIN_REMEDY = "run the same command again; finished experiments are kept and not repeated"


def find_shortage(err: BaseException | None) -> ResourceShortage | None:
    """Return the shortage that an error or one of its causes reports; None if there is none."""
    while err is not None:
        number = getattr(err, "errno", None)
        loading = isinstance(err, ImportError) and any(
            words in str(err) for words in _NO_MEMORY_TO_LOAD_MESSAGES
        )
        if isinstance(err, MemoryError) or number == errno.ENOMEM or loading:
            return ResourceShortage(
                "no memory left",
                expected="more memory, or a higher limit (`ulimit -v`)",
                remedy=f"end other programs, raise the limit, or use fewer workers; then {_RUN_AGAIN_REMEDY}",
            )
        if number in _TOO_MANY_OPEN_FILES_ERRNOS or (
            isinstance(err, ImportError) and os.strerror(errno.EMFILE) in str(err)
        ):
            return ResourceShortage(
                "too many open files",
                expected="a higher limit (`ulimit -n`)",
                remedy=f"raise the limit, for example to 1024, then {_RUN_AGAIN_REMEDY}",
            )
        if number == errno.EAGAIN or _NO_THREAD_MESSAGE in str(err):
            return ResourceShortage(
                "no more processes or threads can be started",
                expected="fewer processes and threads on this machine, or a higher limit (`ulimit -u`)",
                remedy=f"end other programs, raise the limit, or use fewer workers; then {_RUN_AGAIN_REMEDY}",
            )
        err = err.__cause__ or err.__context__
    return None
