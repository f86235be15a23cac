"""The report and the log of a fork."""

import os
from pathlib import Path

from mutator.engines.in_target.fork_output import MOST_LOG_BYTES, ForkOutput
from mutator.engines.received_fork_output import ReceivedForkOutput

REPORT = {"ended": "ok", "error": None, "disk_full": False, "outside": [], "probe": None}


def received(output: ForkOutput) -> ReceivedForkOutput:
    return ReceivedForkOutput(os.dup(output.report), os.dup(output.log))


def test_the_harness_gets_report_log_and_activation() -> None:
    output = ForkOutput()
    with received(output) as left:
        assert (left.read_report(), left.was_fault_active, left.log_tail()) == (None, False, "")
        output.note_activation()
        output.write_report(REPORT)
        os.write(output.log, b"hello\n")
        assert (left.read_report(), left.was_fault_active) == (REPORT, True)
        assert (left.log_tail(), left.is_log_full) == ("hello\n", False)
    output.close()


def test_a_log_does_not_grow_without_end() -> None:
    output = ForkOutput()
    with received(output) as left:
        assert os.write(output.log, bytes(MOST_LOG_BYTES + 1)) == MOST_LOG_BYTES
        assert left.is_log_full
    output.close()


def test_another_file_with_the_number_of_a_closed_report_is_not_written_to(tmp_path: Path) -> None:
    """A run can close all files, and open its own ones."""
    output, path = ForkOutput(), tmp_path / "own"
    number = output.report
    os.close(number)
    os.dup2(handle := os.open(path, os.O_RDWR | os.O_CREAT), number)
    output.note_activation()
    output.write_report(REPORT)
    assert path.read_bytes() == b""
    for file in {handle, number, output.log}:
        os.close(file)
