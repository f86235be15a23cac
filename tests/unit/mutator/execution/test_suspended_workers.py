"""A stopped child goes on, and learns that it was stopped."""

import signal
import subprocess
import sys

from mutator.execution.suspended_workers import WorkerContinuer

CHILD = """
import time
from mutator.execution.suspended_workers import on_resume
on_resume(lambda: print("stopped", flush=True))
print("ready", flush=True)
for _ in range(600):  # one long system call would begin just after the signal, and never end
    time.sleep(0.1)
"""


def test_a_stopped_child_goes_on_and_is_told() -> None:
    with subprocess.Popen([sys.executable, "-c", CHILD], stdout=subprocess.PIPE, text=True) as child:
        assert child.stdout is not None
        assert child.stdout.readline() == "ready\n"
        continuing = WorkerContinuer()
        try:
            child.send_signal(signal.SIGSTOP)
            assert child.stdout.readline() == "stopped\n"
        finally:
            continuing.end()
            child.kill()
