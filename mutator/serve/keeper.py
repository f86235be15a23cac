"""Runs a job as a child process, and lets no part of it outlive the server.

`python -m mutator.serve.keeper FD WORDS...` runs `mutator WORDS...`. FD is the reading end of a pipe; only
the server holds the other end. When that end closes, because the server closes it or is killed, the keeper
asks the command to end, and later kills what is left with its descendants. If the keeper itself is killed,
the kernel kills the command.
"""

import os
import sys

from mutator.engines.in_target import guard

PATIENCE_S = 20.0  # for a command to clean up workers, scratch and half-written files


def main() -> int:
    """Run the command; returns its exit code, or 128 plus the number of the signal that ended it."""
    caller = int(sys.argv[1])
    ended = guard.fork(caller, patience_s=PATIENCE_S)
    if ended is None:
        os.close(caller)
        os.execv(sys.executable, [sys.executable, "-P", "-m", "mutator", *sys.argv[2:]])
    code = int(ended["code"])
    return code if code >= 0 else 128 - code


if __name__ == "__main__":
    sys.exit(main())
