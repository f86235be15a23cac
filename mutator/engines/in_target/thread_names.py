"""The threads of this process, by name. Standard library only."""

import os
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any

_TASKS_FOLDER = Path("/proc/self/task")


def other_thread_names() -> list[str]:
    """Return the names of all threads but the main one, even those of libraries; "" for an unnamed thread."""
    threading: Any = sys.modules.get("threading")
    python_names = {thread.native_id: thread.name for thread in threading.enumerate()} if threading else {}
    try:  # list the threads, because some kernels do not keep the folder's link count up to date
        numbers = [int(task.name) for task in _TASKS_FOLDER.iterdir() if task.name != str(os.getpid())]
    except FileNotFoundError:  # not on Linux
        return sorted(name for name in python_names.values() if name != threading.main_thread().name)
    process_name = _kernel_thread_name(os.getpid()) if numbers else ""
    thread_names = []
    for number in numbers:
        name = _kernel_thread_name(number)
        thread_names.append(python_names.get(number) or ("" if name == process_name else name))
    return sorted(thread_names)


def _kernel_thread_name(number: int) -> str:
    with suppress(OSError):  # the thread has just ended
        return (_TASKS_FOLDER / str(number) / "comm").read_text().strip()
    return ""
