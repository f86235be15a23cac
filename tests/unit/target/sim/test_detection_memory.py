"""The table of detections that runs share."""

import errno
import os
import subprocess
import sys
from pathlib import Path

import pytest
import selfdrive
from selfdrive.sim import detection_memory
from selfdrive.sim.detection_memory import (
    BUCKET_COUNT,
    ENTRIES_PER_BUCKET,
    ENTRY_BYTES,
    FILE_NAME,
    MOST_NUMBERS,
    DetectionMemory,
)

NUMBERS = (1.5, -0.0, float("inf"), 5e-324)


def key(number: int, bucket: int = 7) -> bytes:
    return bucket.to_bytes(8, "little") + number.to_bytes(8, "big")


def test_stored_entries_are_recalled(tmp_path):
    memory = DetectionMemory(tmp_path)
    memory.store(key(1), NUMBERS)
    memory.store(key(2), ())
    memory.store(key(3), range(MOST_NUMBERS))
    other = DetectionMemory(tmp_path)
    assert [value.hex() for value in other.recall(key(1))] == [value.hex() for value in NUMBERS]
    assert other.recall(key(2)) == () and other.recall(key(3)) == tuple(range(MOST_NUMBERS))
    assert other.recall(key(4)) is None and other.recall(key(1, 8)) is None


def test_the_table_never_grows(tmp_path):
    memory = DetectionMemory(tmp_path)
    for number in range(1, 4 * ENTRIES_PER_BUCKET):
        memory.store(key(number), (float(number),))
        assert memory.recall(key(number)) == (float(number),)
    left = [memory.recall(key(number)) for number in range(1, 4 * ENTRIES_PER_BUCKET)]
    assert sum(value is not None for value in left) == ENTRIES_PER_BUCKET
    size = (tmp_path / FILE_NAME).stat()
    assert size.st_size == BUCKET_COUNT * ENTRIES_PER_BUCKET * ENTRY_BYTES and 512 * size.st_blocks < 1 << 20


@pytest.mark.parametrize("at", [0, 16, 24, 32, ENTRY_BYTES - 1])
def test_a_damaged_entry_is_not_recalled_and_can_be_stored_again(tmp_path, at):
    memory = DetectionMemory(tmp_path)
    memory.store(key(1), NUMBERS)
    with (tmp_path / FILE_NAME).open("r+b") as file:
        file.seek(7 * ENTRIES_PER_BUCKET * ENTRY_BYTES + at)
        byte = file.read(1)[0]
        file.seek(-1, os.SEEK_CUR)
        file.write(bytes([byte ^ 4]))
    assert memory.recall(key(1)) is None
    memory.store(key(1), NUMBERS)
    assert memory.recall(key(1)) == NUMBERS


def test_a_file_with_other_content_does_not_prevent_storing(tmp_path):
    (tmp_path / FILE_NAME).write_bytes(b"no table" * 5000)
    memory = DetectionMemory(tmp_path)
    assert memory.recall(key(1, 2)) is None
    memory.store(key(1, 2), NUMBERS)
    assert memory.recall(key(1, 2)) == NUMBERS


def test_nothing_is_stored_if_the_file_cannot_be_opened(tmp_path):
    (tmp_path / FILE_NAME).mkdir()
    memory = DetectionMemory(tmp_path)
    memory.store(key(1), NUMBERS)
    assert memory.recall(key(1)) is None


def test_a_full_disk_only_prevents_storing(tmp_path, monkeypatch):
    memory = DetectionMemory(tmp_path)

    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(detection_memory.os, "pwrite", full)
    memory.store(key(1), NUMBERS)
    assert memory.recall(key(1)) is None


WRITER = """
import sys
from pathlib import Path
from selfdrive.sim.detection_memory import DetectionMemory
memory = DetectionMemory(Path(sys.argv[1]))
for turn in range(30):
    for number in range(1, 200):
        key = (number % 5).to_bytes(8, "little") + number.to_bytes(8, "little")
        assert memory.recall(key) in (None, (float(number),) * (number % 20))
        memory.store(key, (float(number),) * (number % 20))
"""


def test_two_processes_can_write_at_once(tmp_path):
    root = str(Path(selfdrive.__path__[0]).parent)
    command = [sys.executable, "-c", WRITER, str(tmp_path)]
    both = [subprocess.Popen(command, env={"PYTHONPATH": root}) for _ in range(2)]
    assert [one.wait() for one in both] == [0, 0]


def test_a_forked_child_shares_the_memory(tmp_path):
    code = (
        "import os, sys; from pathlib import Path\n"
        "from selfdrive.sim.detection_memory import DetectionMemory\n"
        "memory = DetectionMemory(Path(sys.argv[1])); key = bytes(range(16))\n"
        "if os.fork() == 0: memory.store(key, (4.0,)); os._exit(0)\n"
        "os.wait(); print(memory.recall(key))"
    )
    root = str(Path(selfdrive.__path__[0]).parent)
    command = [sys.executable, "-c", code, str(tmp_path)]
    done = subprocess.run(command, env={"PYTHONPATH": root}, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "(4.0,)"
