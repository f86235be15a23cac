"""The report and log of a fork, as the harness gets them: files in memory, which the run can write to."""

import os
from typing import Any

from mutator._common.bounded_reading import MOST_FILE_BYTES
from mutator.engines.in_target.fork_output import ACTIVE, MOST_LOG_BYTES
from mutator.engines.process_endings import log_tail, parse_run_report


class ReceivedForkOutput:
    """The descriptors of a report and a log (`in_target/fork_output.py`), open until the end of a `with`
    block.
    """

    def __init__(self, report: int, log: int) -> None:
        self._report, self._log = report, log

    def __enter__(self) -> "ReceivedForkOutput":
        return self

    def __exit__(self, *error: object) -> None:
        os.close(self._report)
        os.close(self._log)

    def read_report(self, **extra_fields: type) -> dict[str, Any] | None:
        """Return the fork's report; None if it is missing, incomplete or invalid (`parse_run_report`)."""
        byte_count = os.fstat(self._report).st_size
        if byte_count > MOST_FILE_BYTES:
            return None
        return parse_run_report(os.pread(self._report, byte_count, len(ACTIVE)), **extra_fields)

    @property
    def was_fault_active(self) -> bool:
        return os.pread(self._report, len(ACTIVE), 0) == ACTIVE

    @property
    def is_log_full(self) -> bool:
        return self._printed_bytes() >= MOST_LOG_BYTES

    def log_tail(self) -> str:
        return log_tail(self._log, self._printed_bytes())

    def _printed_bytes(self) -> int:
        return os.lseek(self._log, 0, os.SEEK_CUR)  # the position is the run's
