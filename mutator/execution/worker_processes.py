"""Worker processes: how a command starts them over a connection, and how they end with it."""

import os
import signal
import socket
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from multiprocessing.connection import Connection
from pathlib import Path

from mutator.engines.in_target import process_guard


def python_command_dying_with(parent_pid: int) -> list[str]:
    """Return the beginning of a Python command line whose process dies with its parent, even while starting.

    It imports nothing from its working folder.
    """
    # without site-packages, which the guard does not need and which take time to find
    return [sys.executable, "-I", "-S", process_guard.__file__, str(parent_pid), sys.executable, "-P"]


def bind_to_parent(parent_pid: int) -> None:
    """End this process when `parent_pid` ends, and ignore Ctrl-C, which the parent handles."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    process_guard.die_with_parent(parent_pid)


def start_worker_process(
    module: str, data: bytes, arguments: Sequence[str] = (), *, folder: Path | None = None
) -> tuple["subprocess.Popen[bytes]", Connection]:
    """Start `python -m MODULE FD FILE ARGUMENTS`, which dies with this thread; return it and the connection.

    FD is the other end of the connection, and FILE an open file with `data`. `folder` is where the process
    works, and where the nameless file is.
    """
    here, there = socket.socketpair()
    try:
        with tempfile.TemporaryFile(dir=folder) as file:  # nameless, so no run can change it
            file.write(data)
            file.seek(0)
            descriptors = [there.fileno(), file.fileno()]
            process = subprocess.Popen(
                [*python_command_dying_with(os.getpid()), "-m", module, *map(str, descriptors), *arguments],
                pass_fds=descriptors,
                cwd=folder,
                stdin=subprocess.DEVNULL,
                start_new_session=True,  # signals from the terminal are for the command only
            )
    except BaseException:
        here.close()
        raise
    finally:
        there.close()
    return process, Connection(here.detach())


def opened_by_parent(arguments: Sequence[str]) -> tuple[Connection, bytes]:
    """Return the connection to the parent, and the data from it. `arguments` begin with FD and FILE."""
    connection = Connection(int(arguments[0]))
    with os.fdopen(int(arguments[1]), "rb") as file:
        return connection, file.read()
