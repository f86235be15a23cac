"""Keeps a job: runs the command line as a child, and lets nothing of it outlive the server.

`python -m mutator.serve.keeper FD WORDS...` runs `mutator WORDS...`. FD is the reading end of a pipe whose
other end the server alone holds. Once that is closed, by the server or because it was killed, the command is
asked to end; what is left after a while is killed, with all that came of it. Should the keeper itself be
killed, the kernel kills the command.
"""

import os
import sys

from mutator.engines.in_target import guard

PATIENCE_S = 20.0  # for a command to end in order: workers, scratch, half-written files


def main() -> int:
    """Run the command; its exit code, or 128 and the number of the signal that ended it."""
    caller = int(sys.argv[1])
    ended = guard.fork(caller, patience_s=PATIENCE_S)
    if ended is None:
        os.close(caller)
        os.execv(sys.executable, [sys.executable, "-P", "-m", "mutator", *sys.argv[2:]])
    code = int(ended["code"])
    return code if code >= 0 else 128 - code


if __name__ == "__main__":
    sys.exit(main())
