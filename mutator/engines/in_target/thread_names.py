"""The threads of this process, by name. Standard library only."""

import os
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any

_TASKS = Path("/proc/self/task")


def others() -> list[str]:
    """Return the names of all threads but the main one, even those of libraries; "" for an unnamed thread."""
    threading: Any = sys.modules.get("threading")
    known = {one.native_id: one.name for one in threading.enumerate()} if threading else {}
    try:  # list the threads, because some kernels do not keep the folder's link count up to date
        numbers = [int(task.name) for task in _TASKS.iterdir() if task.name != str(os.getpid())]
    except FileNotFoundError:  # not on Linux
        return sorted(name for name in known.values() if name != threading.main_thread().name)
    own = _system_name(os.getpid()) if numbers else ""
    found = []
    for number in numbers:
        name = _system_name(number)
        found.append(known.get(number) or ("" if name == own else name))
    return sorted(found)


def _system_name(number: int) -> str:
    with suppress(OSError):  # the thread has just ended
        return (_TASKS / str(number) / "comm").read_text().strip()
    return ""
