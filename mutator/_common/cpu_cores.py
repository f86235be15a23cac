import os
from pathlib import Path

_CPU_QUOTA_PATH = Path("/sys/fs/cgroup/cpu.max")  # a container's cgroup v2 quota: microseconds per period


def usable_cores() -> int:
    """Return the number of cores that this process can use, limited by a container's quota."""
    cores = len(os.sched_getaffinity(0))
    try:
        quota, period = _CPU_QUOTA_PATH.read_text().split()
        return max(1, min(cores, round(int(quota) / int(period))))
    except (OSError, ValueError, ZeroDivisionError):  # no quota: no such file, or "max"
        return cores
