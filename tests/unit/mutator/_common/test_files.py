"""The harness's own files: schema versions, atomic writes and full disks."""

import errno
import os
import shutil
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from mutator._common import files
from mutator._common.files import (
    ScratchFolder,
    check_schema,
    raising_disk_full,
    read_json,
    remove_folder,
    write_atomic,
    write_json,
)
from mutator.errors import EXIT_HARNESS_ERRORS, DiskFull, MutatorError


def test_a_written_object_is_read_back_unchanged(tmp_path: Path) -> None:
    write_json(tmp_path / "a.json", {"schema": "a/1", "x": [1, None]})
    assert read_json(tmp_path / "a.json", "a/1") == {"schema": "a/1", "x": [1, None]}


@pytest.mark.parametrize(
    "text", ["", "{", "[]", "{}", '{"schema": "b/1"}', '{"schema": "a"}', '{"schema": 1}']
)
def test_the_error_names_a_file_without_the_expected_schema(tmp_path: Path, text: str) -> None:
    path = tmp_path / "a.json"
    path.write_text(text)
    with pytest.raises(MutatorError, match=r"a\.json"):
        read_json(path, "a/1")


def test_a_pipe_is_refused_without_waiting(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "a.json")
    with pytest.raises(MutatorError, match=r"a\.json: not a file"):
        read_json(tmp_path / "a.json", "a/1")


ANEW = "use the version of mutator that wrote it, or write it anew with this one"


@pytest.mark.parametrize(
    ("found", "got", "remedy"),
    [
        ("run/1", "schema 'run/1'", ANEW),
        ("run/3", "schema 'run/3'", "use a newer version of mutator"),
        ("run/03x", "schema 'run/03x'", ANEW),
        ("bus/9", "schema 'bus/9'", ANEW),
        (None, "no schema", ANEW),
        (["run/2"], "schema ['run/2']", ANEW),
    ],
)
def test_another_schema_is_refused_in_a_sentence(found: object, got: str, remedy: str) -> None:
    check_schema("run/2", "run/2", "run.json")
    with pytest.raises(MutatorError) as caught:
        check_schema(found, "run/2", "run.json", line=1)
    assert str(caught.value) == f"run.json:1: {got}; expected run/2; {remedy}"


def test_deep_and_locked_folders_are_removed_but_not_the_targets_of_links(tmp_path: Path) -> None:
    kept, folder = tmp_path / "kept", tmp_path / "folder"
    kept.mkdir()
    (kept / "x").touch()
    before = kept.stat().st_mode
    (folder / "locked" / "inside").mkdir(parents=True)
    (folder / "link").symlink_to(kept)
    os.mkfifo(folder / "pipe")
    (folder / "locked").chmod(0)
    here = Path.cwd()
    os.chdir(folder)
    for _ in range(1200):
        Path("deep").mkdir()
        os.chdir("deep")
    os.chdir(here)
    (tmp_path / "link").symlink_to(kept)
    for path in (folder, tmp_path / "link", tmp_path / "none"):
        remove_folder(path)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["kept", "link"]
    assert (kept / "x").exists() and kept.stat().st_mode == before


def test_a_scratch_folder_is_deleted_after_its_block_or_with_its_object(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    with ScratchFolder("x-") as folder:
        (folder / "y").mkdir()
    scratch = ScratchFolder("x-")
    (path,) = tmp_path.iterdir()
    assert path == scratch.path
    del scratch
    assert list(tmp_path.iterdir()) == []


def test_a_full_disk_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
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


def test_readers_see_complete_files_while_several_writers_write(tmp_path: Path) -> None:
    path = tmp_path / "file"
    texts = [bytes([number]) * 100_000 for number in range(4)]
    write_atomic(path, texts[0])
    with ThreadPoolExecutor(4) as pool:
        writers = [pool.submit(write_atomic, path, text) for text in texts * 20]
        while not all(writer.done() for writer in writers):
            assert path.read_bytes() in texts
        assert [writer.result() for writer in writers] == [None] * 80
    assert list(tmp_path.iterdir()) == [path]


def test_other_failures_are_not_reported_as_a_full_disk(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        write_atomic(tmp_path / "nosuch" / "file", b"")


def no_room(*_: object, **__: object) -> None:
    raise OSError(errno.EDQUOT, os.strerror(errno.EDQUOT))


def test_a_full_disk_is_recognized_in_other_errors(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """`shutil` raises an error with a list of texts, and libraries raise their own errors."""
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
    one, other = RuntimeError("one"), RuntimeError("other")
    one.__context__, other.__context__ = other, one  # frameworks create cycles of causes
    with pytest.raises(RuntimeError, match="one"), raising_disk_full(tmp_path):
        raise one
    with pytest.raises(MutatorError, match="mine"), raising_disk_full(tmp_path):
        raise MutatorError("mine") from OSError(errno.ENOSPC, "")


def test_deleting_a_folder_that_is_moved_meanwhile_deletes_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """While `deep` is open, a process moves it out of `run/a`, so that its parent is another folder."""
    run, kept = tmp_path / "run", tmp_path / "b" / "kept"
    for folder in (run / "a" / "deep", run / "a" / "b", kept):
        folder.mkdir(parents=True)
    (kept / "file").touch()
    real = files._delete_files_and_list_folders

    def moving(folder: int) -> list[str]:
        name, found = Path(f"/proc/self/fd/{folder}").readlink().name, real(folder)
        if name == "deep":
            (run / "a" / "deep").rename(tmp_path / "deep")
        return sorted(found)  # the last one is emptied first

    monkeypatch.setattr(files, "_delete_files_and_list_folders", moving)
    remove_folder(run)
    assert (kept / "file").exists()
