"""Whether processes have ended."""

import time
from pathlib import Path


def ended(pid: int) -> bool:
    """Return whether the process ends, or becomes a zombie; on a busy machine, that can take seconds."""
    deadline = time.monotonic() + 20.0
    while time.monotonic() < deadline:
        try:
            state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
        except (FileNotFoundError, ProcessLookupError):
            return True
        if state == "Z":
            return True
        time.sleep(0.05)
    return False
