"""Count what the probe does in child processes that the target forks. Standard library only.

A forked child inherits the probe with its state, so a fault that is active acts in it, too. The child's
counts are lost with its memory, so each activation is appended to a file, which the run reads at its end.
"""

import os
from contextlib import suppress
from pathlib import Path
from typing import Any

_MOST_FILE_BYTES = 64 << 20  # more activations than this are not read


def count_in_children(probe: Any, file: str) -> None:
    """From now on, append each activation in a forked child to `file`: injection and time (s)."""
    is_child = False

    def begin_in_child() -> None:
        nonlocal is_child
        if not is_child:  # a child of a child has inherited it
            is_child = True
            _append_activations(probe, file)

    os.register_at_fork(after_in_child=begin_in_child)


def _append_activations(probe: Any, file: str) -> None:
    decide = probe.active

    def active(fi: str) -> Any:
        acts = decide(fi)
        probe.active = active  # the first activation of a run puts another function here
        if acts:
            with suppress(Exception):
                line = f"{fi} {probe.report()['injections'][fi]['last']!r}\n"
                handle = os.open(file, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o644)
                try:
                    os.write(handle, line.encode())
                finally:
                    os.close(handle)
        return acts

    probe.active = active


def add_children(report: Any, file: str) -> None:
    """Add the activations of the children to a probe's report, if its own trigger held, too."""
    with suppress(OSError, LookupError, TypeError, ValueError):
        if report["triggered"] is None or Path(file).stat().st_size > _MOST_FILE_BYTES:
            return
        with Path(file).open(encoding="utf-8") as lines:
            for fi, time in (line.split() for line in lines):
                entry, t = report["injections"][fi], float(time)
                entry["first"] = t if entry["count"] == 0 else min(entry["first"], t)
                entry["last"] = t if entry["count"] == 0 else max(entry["last"], t)
                entry["count"] += 1
