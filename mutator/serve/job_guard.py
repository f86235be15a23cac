"""Runs a job as a child process, and ends all its processes when the server ends.

`python -m mutator.serve.job_guard FD WORDS...` runs `mutator WORDS...`. FD is the reading end of a pipe from
the server. When the writing end closes, the guard asks the command to end, and later kills it with its
descendants. If the guard itself is killed, the kernel kills the command.
"""

import os
import sys

from mutator.engines.in_target import process_guard

MOST_CLEANUP_S = 20.0  # a command's time to clean up workers, scratch folders and half-written files


def main() -> int:
    """Run the command; return its exit code, or 128 plus the signal that ended it."""
    server_pipe = int(sys.argv[1])
    child_end = process_guard.fork_guarded(server_pipe, patience_s=MOST_CLEANUP_S)
    if child_end is None:
        os.close(server_pipe)
        process_guard.restore_default_signals()
        os.execv(sys.executable, [sys.executable, "-P", "-m", "mutator", *sys.argv[2:]])
    code = int(child_end["code"])
    return code if code >= 0 else 128 - code


if __name__ == "__main__":
    sys.exit(main())
