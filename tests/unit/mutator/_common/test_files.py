"""The harness's own files: schema versions, whole writes, a full disk."""

import errno
import os
import shutil
from pathlib import Path

import pytest

from mutator._common.files import (
    DiskFull,
    check_schema,
    no_pipe,
    raising_disk_full,
    read_json,
    write_atomic,
    write_json,
)
from mutator.errors import EXIT_HARNESS_ERRORS, MutatorError


def test_what_is_written_is_read(tmp_path: Path) -> None:
    """A JSON object of the right schema comes back as it was."""
    write_json(tmp_path / "a.json", {"schema": "a/1", "x": [1, None]})
    assert read_json(tmp_path / "a.json", "a/1") == {"schema": "a/1", "x": [1, None]}


@pytest.mark.parametrize(
    "text", ["", "{", "[]", "{}", '{"schema": "b/1"}', '{"schema": "a"}', '{"schema": 1}']
)
def test_other_files_are_refused(tmp_path: Path, text: str) -> None:
    """What is no JSON object of that schema is an error that names the file."""
    path = tmp_path / "a.json"
    path.write_text(text)
    with pytest.raises(MutatorError, match=r"a\.json"):
        read_json(path, "a/1")


def test_nobody_waits_for_a_pipe(tmp_path: Path) -> None:
    """A pipe in the place of a file is no file; a file is read as ever."""
    os.mkfifo(tmp_path / "a.json")
    with pytest.raises(MutatorError, match=r"a\.json: no file"):
        read_json(tmp_path / "a.json", "a/1")
    (tmp_path / "b").write_bytes(b"x")
    assert no_pipe(tmp_path / "b").read_bytes() == b"x"


def test_newer_schema_is_refused() -> None:
    """A newer version is told as such, with what to do; an older one is read."""
    check_schema("run/1", "run/2", Path("run.json"))
    with pytest.raises(MutatorError, match=r"run\.json: schema 'run/3' .*newer mutator.*update mutator"):
        check_schema("run/3", "run/2", Path("run.json"))


def test_full_disk_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without room the old file stays whole, nothing is left over, and the answer says what to do."""
    path = tmp_path / "results.csv"
    path.write_bytes(b"old")

    def full(fd: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(DiskFull, match=r"results\.csv: no space left.*same command again") as error:
        write_atomic(path, b"new")
    assert error.value.exit_code == EXIT_HARNESS_ERRORS
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_other_failures_are_not_called_a_full_disk(tmp_path: Path) -> None:
    """A folder that is not there is not told as a full disk."""
    with pytest.raises(FileNotFoundError):
        write_atomic(tmp_path / "nosuch" / "file", b"")


def no_room(*_: object, **__: object) -> None:
    raise OSError(errno.EDQUOT, os.strerror(errno.EDQUOT))


def test_a_full_disk_in_other_words(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A full disk or quota is told as one when `shutil` has put it into a list of texts, and when a library
    has made another error of it."""
    (tmp_path / "from").mkdir()
    (tmp_path / "from" / "file").touch()
    monkeypatch.setattr(shutil, "copyfile", no_room)
    with pytest.raises(DiskFull, match="no space left"), raising_disk_full(tmp_path):
        shutil.copytree(tmp_path / "from", tmp_path / "to")
    with pytest.raises(DiskFull), raising_disk_full(tmp_path):
        try:
            no_room()
        except OSError:
            raise RuntimeError("cannot encode") from None
    with pytest.raises(RuntimeError), raising_disk_full(tmp_path):
        raise RuntimeError("cannot encode")
    with pytest.raises(MutatorError, match="mine"), raising_disk_full(tmp_path):
        raise MutatorError("mine") from OSError(errno.ENOSPC, "")
