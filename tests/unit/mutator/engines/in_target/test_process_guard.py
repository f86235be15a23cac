"""Guarded forks."""

import signal
import subprocess
import sys
from pathlib import Path

import pytest

from mutator.engines.in_target import process_guard

FORK = """
import os, signal, sys
sys.path.insert(0, sys.argv[1])
import process_guard
read, write = os.pipe()
signal.signal(signal.SIGINT, signal.SIG_IGN)
if process_guard.fork_guarded(read) is None:
    if sys.argv[2] == "restored":
        process_guard.restore_default_signals()
    print(signal.getsignal(signal.SIGINT) is signal.SIG_IGN)
"""


@pytest.mark.parametrize(("how", "ignores"), [("inherited", "True"), ("restored", "False")])
def test_a_fork_ignores_the_signals_of_its_parent_until_they_are_restored(how: str, ignores: str) -> None:
    """A fork of a golden run keeps what the target has set; a new run gets the defaults."""
    folder = Path(process_guard.__file__).parent
    run = subprocess.run(
        [sys.executable, "-c", FORK, folder, how], capture_output=True, text=True, check=True
    )
    assert run.stdout.strip() == ignores
    assert signal.getsignal(signal.SIGINT) is not signal.SIG_IGN
