"""What a fork leaves outside its folder: a report and a log, in memory. Standard library only.

The process that forks makes both, and hands them to the harness. No file has to be made, read and deleted.
"""

import fcntl
import json
import os
from typing import Any

MOST_LOG_BYTES = 1 << 20  # a longer log is for the disk, whose limit counts it
_F_ADD_SEALS, _F_SEAL_SHRINK, _F_SEAL_GROW = 1033, 2, 4  # from linux/fcntl.h; Python before 3.13 lacks names
INACTIVE, ACTIVE = b"0", b"1"  # the first byte of a report: whether the fault has been active


class ForkOutput:
    """The open report and log of a fork that is still to be made."""

    def __init__(self) -> None:
        self.report = os.memfd_create("report")
        self.log = os.memfd_create("log", os.MFD_CLOEXEC | os.MFD_ALLOW_SEALING)
        os.write(self.report, INACTIVE)
        # of a fixed size, without taking memory: beyond it, writing fails, and the harness sees a full log
        os.ftruncate(self.log, MOST_LOG_BYTES)
        fcntl.fcntl(self.log, _F_ADD_SEALS, _F_SEAL_SHRINK | _F_SEAL_GROW)
        self._report_inode = os.fstat(self.report).st_ino

    def close(self) -> None:
        os.close(self.report)
        os.close(self.log)

    def print_to_log(self) -> None:
        """In the fork: let standard output and error be the log."""
        os.dup2(self.log, 1)
        os.dup2(self.log, 2)
        os.close(self.log)

    def note_activation(self) -> None:
        self._write_at(0, ACTIVE)

    def write_report(self, report: dict[str, Any]) -> None:
        self._write_at(1, json.dumps(report).encode())

    def _write_at(self, offset: int, data: bytes) -> None:
        """Write to the report, unless a run has closed it; then the number can be that of another file."""
        if os.fstat(self.report).st_ino == self._report_inode:
            while data:
                count = os.pwrite(self.report, data, offset)
                data, offset = data[count:], offset + count
