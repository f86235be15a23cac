"""Files that grow, and what a killed command leaves in them."""

from pathlib import Path

import pytest

from mutator.store import file_digests
from mutator.store.appended_files import AppendedFile, undo_unfinished_growth
from mutator.store.file_digests import DigestLedger, FileDigest
from mutator.store.run_head import HEAD

NAME = "plan/faults.jsonl"


@pytest.fixture
def run(tmp_path: Path) -> Path:
    (tmp_path / "plan").mkdir()
    (tmp_path / NAME).write_bytes(b"one\n")
    (tmp_path / HEAD).write_bytes(b"head of one")
    files = {name: FileDigest.of_bytes((tmp_path / name).read_bytes()) for name in (NAME, HEAD)}
    file_digests.save_ledger(tmp_path, DigestLedger(files=files))
    return tmp_path


def announce(run: Path) -> AppendedFile:
    """Announce that a line and a head are to be written."""
    file = AppendedFile(run, NAME)
    file.add(b"two\n")
    new = {NAME: file.digest, HEAD: FileDigest.of_bytes(b"head of two")}
    before = file_digests.load_ledger(run)
    file_digests.save_ledger(run, DigestLedger(files=before.files, rewriting=new))
    return file


def test_the_digest_is_that_of_the_whole_file(run: Path) -> None:
    """The digest goes on over what is added, without reading the file again."""
    file = AppendedFile(run, NAME)
    file.add(b"two\n")
    file.add(b"three\n")
    file.write_added()
    assert (run / NAME).read_bytes() == b"one\ntwo\nthree\n"
    assert file.digest == FileDigest.of_file(run / NAME)


@pytest.mark.parametrize("added", [b"", b"tw", b"two\n"])
def test_what_was_added_without_a_head_is_cut_off(run: Path, added: bytes) -> None:
    """A kill before the head is written leaves the plan as it was, however much was appended."""
    announce(run)
    with (run / NAME).open("ab") as file:
        file.write(added)
    undo_unfinished_growth(run, (NAME, "plan.csv"))
    assert (run / NAME).read_bytes() == b"one\n"


def test_what_the_head_names_stays(run: Path) -> None:
    """A kill after the head was written loses nothing."""
    announce(run).write_added()
    (run / HEAD).write_bytes(b"head of two")
    undo_unfinished_growth(run, (NAME,))
    assert (run / NAME).read_bytes() == b"one\ntwo\n"


def test_a_file_with_another_beginning_is_left_alone(run: Path) -> None:
    """Damage is for the verification to report, not to cut."""
    announce(run)
    (run / NAME).write_bytes(b"ONE\ntwo\n")
    undo_unfinished_growth(run, (NAME,))
    assert (run / NAME).read_bytes() == b"ONE\ntwo\n"
