"""How many processor cores this process may use."""

import os
from pathlib import Path

_QUOTA = Path("/sys/fs/cgroup/cpu.max")  # of a container, with cgroup version 2: microseconds, of a period


def usable_cores() -> int:
    """The cores that this process is allowed to run on, or fewer where a container's quota is smaller."""
    cores = len(os.sched_getaffinity(0))
    try:
        quota, period = _QUOTA.read_text().split()
        return max(1, min(cores, round(int(quota) / int(period))))
    except (OSError, ValueError, ZeroDivisionError):  # there is no quota: no such file, or it says "max"
        return cores
