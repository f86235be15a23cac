"""What one call costs a started harness, measured in a forked child with limits."""

import os
import resource
import signal
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from mutator.errors import MutatorError

MOST_CPU_S = 2.0  # on a quiet machine
MOST_MEMORY_MB = 200.0
# an empty loop, and its CPU time on a quiet machine, where `benchmarks/step.py` drives 30 s in 0.19 s
_LOOP_STEPS, _QUIET_LOOP_S = 1_000_000, 0.0165
_CAP_S = 20  # so that a call without a limit does not stop the suite
_CAP_BYTES = 2_000_000_000


@dataclass(frozen=True)
class Cost:
    """CPU time and additional memory of a call, and the text of the MutatorError with which it ended.

    `error` is empty if the call ended well; it begins with `failed` for any other end.
    """

    cpu_s: float
    memory_mb: float
    error: str


def cost_of(act: Callable[[], object]) -> Cost:
    """Call `act` in a forked child and return what it cost."""
    reader, writer = os.pipe()
    before = _memory_mb()
    child = os.fork()
    if child == 0:
        os.close(reader)
        _act(act, writer)
    os.close(writer)
    with os.fdopen(reader, "rb") as told:
        error = told.read().decode()
    _, status, usage = os.wait4(child, 0)
    if status:
        error = f"failed: status {status}, {signal.strsignal(os.WTERMSIG(status))}"
    used_s = usage.ru_utime + usage.ru_stime
    return Cost(cpu_s=used_s, memory_mb=max(0.0, usage.ru_maxrss / 1024 - before), error=error)


def is_refused(act: Callable[[], object]) -> str:
    """Return the error with which `act` ends, after checking that it came soon and with little memory."""
    cost = cost_of(act)
    assert cost.error and not cost.error.startswith("failed"), cost
    assert is_soon(cost.cpu_s) and cost.memory_mb < MOST_MEMORY_MB, cost
    assert "\n" not in cost.error
    return cost.error


def is_cheap(act: Callable[[], object]) -> None:
    """Check that `act` ends soon and with little memory, in a result or a MutatorError."""
    cost = cost_of(act)
    assert not cost.error.startswith("failed"), cost
    assert is_soon(cost.cpu_s) and cost.memory_mb < MOST_MEMORY_MB, cost


def is_soon(cpu_s: float) -> bool:
    """Whether a quiet machine needs less than MOST_CPU_S for what took `cpu_s` here, now."""
    if cpu_s < MOST_CPU_S:
        return True
    return cpu_s * _QUIET_LOOP_S / max(_loop_cpu_s() for _ in range(5)) < MOST_CPU_S


def _loop_cpu_s() -> float:
    began = time.process_time()
    for _ in range(_LOOP_STEPS):
        pass
    return time.process_time() - began


def _act(act: Callable[[], object], writer: int) -> None:
    resource.setrlimit(resource.RLIMIT_CPU, (_CAP_S, _CAP_S))
    taken = _pages(0) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (taken + _CAP_BYTES, taken + _CAP_BYTES))
    error = ""
    try:
        act()
    except MutatorError as err:
        error = str(err)
    except BaseException as err:
        error = f"failed: {type(err).__name__}: {err}"[:500]
    os.write(writer, error.encode("utf-8", "replace"))
    os._exit(0)


def _memory_mb() -> float:
    return _pages(1) * resource.getpagesize() / 2**20


def _pages(at: int) -> int:
    return int(Path("/proc/self/statm").read_text(encoding="ascii").split()[at])
