"""The processes that targets run in: what they are started with, and how their end is told."""

import json
import os
import re
import select
import signal
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mutator.model import Limits, Status

_LOG_TAIL = 4000
_LEAST_FREE = 4 << 20  # a failed run on a disk with less room than this is not the target's failure
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMEXPR_NUM_THREADS")
_OUTSIDE_SIGNALS = (signal.SIGKILL, signal.SIGTERM, signal.SIGINT, signal.SIGHUP, signal.SIGQUIT)


@dataclass(frozen=True, slots=True, kw_only=True)
class Ended:
    """How a child process ended: wait status, its CPU and wall time, and whether its engine killed it."""

    code: int
    cpu_s: float
    wall_s: float
    out_of_wall: bool


def judge_silent(limits: Limits, ended: Ended) -> tuple[Status, str]:
    """Status and detail of a run that was stopped, or that ended without a report."""
    if ended.out_of_wall:
        return Status.TIMEOUT, f"wall time limit of {limits.wall_s} s"
    if ended.code == -signal.SIGXCPU or (ended.code == -signal.SIGKILL and ended.cpu_s >= limits.cpu_s):
        return Status.TIMEOUT, f"CPU time limit of {limits.cpu_s} s"
    if ended.code < 0 and -ended.code in _OUTSIDE_SIGNALS:
        return Status.HARNESS_ERROR, f"killed from outside by {signal.Signals(-ended.code).name}"
    if ended.code < 0:
        return Status.CRASHED, f"killed by {signal.Signals(-ended.code).name}"
    return Status.CRASHED, f"left with status {ended.code} without a report"


def judge_report(limits: Limits, report: dict[str, Any]) -> tuple[Status, str]:
    """Status and detail of a run of the right tree that reported how it ended."""
    if report["ended"] == "steps":
        return Status.TIMEOUT, f"limit of {limits.steps} simulation steps"
    if report["ended"] == "error":
        return Status.CRASHED, report["error"]
    return Status.OK, ""


def environment(hash_seed: int, folder: Path) -> dict[str, str]:
    """The whole environment of a run: nothing of the user's but what starting Python needs."""
    kept = {name: os.environ[name] for name in ("PATH", "LD_LIBRARY_PATH", "HOME") if name in os.environ}
    return kept | {
        "LC_ALL": "C.UTF-8",
        "PYTHONUTF8": "1",
        "PYTHONHASHSEED": str(hash_seed),
        "PYTHONDONTWRITEBYTECODE": "1",
        "TMPDIR": str(folder),
        **dict.fromkeys(THREADS, "1"),
    }


def ended_within(pid: int, seconds: float) -> bool:
    """Whether the child ended within that time; it is not reaped."""
    if not hasattr(os, "pidfd_open"):
        time.sleep(min(seconds, 0.02))
        return os.waitid(os.P_PID, pid, os.WEXITED | os.WNOHANG | os.WNOWAIT) is not None
    handle = os.pidfd_open(pid)
    try:
        poll = select.poll()
        poll.register(handle, select.POLLIN)
        return bool(poll.poll(seconds * 1000))
    finally:
        os.close(handle)


def kill_group(pid: int) -> None:
    """Kill the child and whatever it started; nothing happens when all are gone."""
    try:
        os.killpg(pid, signal.SIGKILL)
    except (ProcessLookupError, PermissionError):
        return


def tail(path: Path) -> str:
    with path.open("rb") as file:
        file.seek(max(0, path.stat().st_size - _LOG_TAIL))
        return file.read().decode("utf-8", "replace")


def read_report(path: Path) -> dict[str, Any] | None:
    """The child's report; None when it did not come to write one, or only a part of it."""
    try:
        report: dict[str, Any] = json.loads(path.read_bytes())
    except (OSError, ValueError):
        return None
    return report


def is_full(work: Path, report: dict[str, Any] | None) -> bool:
    if report is not None and report["disk_full"]:
        return True
    state = os.statvfs(work)
    return state.f_bavail * state.f_frsize < _LEAST_FREE


def steady(detail: str, folder: Path) -> str:
    """The text without what differs from run to run (scratch paths, addresses), printable, kept short."""
    text = detail.replace(str(folder / "tree") + os.sep, "").replace(str(folder), "...")
    text = re.sub(r"0x[0-9a-fA-F]{4,}", "0x...", text)[:500]
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)
