"""Golden runs in a run folder, packed and in folders: readers see no difference."""

from pathlib import Path

import pytest

from mutator._common.hashing import digest
from mutator.errors import MutatorError
from mutator.store.checksummed_blocks import block_bytes
from mutator.store.golden_files import (
    GoldenFolders,
    copy_golden,
    golden_output_folder,
    move_golden,
    pack_golden,
    read_golden_files,
    stored_golden,
    stored_golden_keys,
)
from mutator.store.trace_packing import pack_file

FILES = {"trace.csv": b"t,v\n0,1\n", "more/record.json": b"{}"}


@pytest.fixture
def golden(tmp_path: Path) -> Path:
    """A folder with the same run packed and unpacked."""
    for name, data in FILES.items():
        path = tmp_path / "golden" / "A" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
    pack_golden(tmp_path / "golden" / "A", tmp_path / "golden", "B")
    return tmp_path / "golden"


def test_a_packed_run_has_the_same_files(golden: Path) -> None:
    assert read_golden_files(golden, "A") == read_golden_files(golden, "B") == FILES
    for key in ("A", "B"):
        output = golden_output_folder(golden, key)
        assert {name: (output / name).read_bytes() for name in FILES} == FILES
    assert stored_golden_keys(golden) == ["A", "B"]


def test_a_missing_run_has_no_files(golden: Path) -> None:
    assert not golden_output_folder(golden, "C").exists()
    assert read_golden_files(golden, "C") == {}


@pytest.mark.parametrize("key", ["A", "B"])
def test_a_run_is_copied_and_moved_as_it_is_stored(golden: Path, tmp_path: Path, key: str) -> None:
    """Also over an earlier one."""
    for _ in range(2):
        move_golden(copy_golden(golden, key, tmp_path / "copy"), tmp_path / "other")
    assert read_golden_files(tmp_path / "other", key) == FILES
    assert stored_golden(tmp_path / "other", key).is_file() == (key == "B")


def test_links_are_not_packed(golden: Path, tmp_path: Path) -> None:
    """A target can write a link to anything that the user can read."""
    (tmp_path / "secret").write_text("mine")
    (golden / "A" / "link").symlink_to(tmp_path / "secret")
    pack_golden(golden / "A", golden, "B")
    assert read_golden_files(golden, "B") == FILES


def test_unpacked_runs_follow_the_file_and_are_deleted(golden: Path, tmp_path: Path) -> None:
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    folders = GoldenFolders(scratch, most_unpacked=2)
    first = folders.output_folder(golden, "B")
    assert folders.output_folder(golden, "B") == first
    (golden / "A" / "trace.csv").write_text("other")
    pack_golden(golden / "A", golden, "B")
    assert (folders.output_folder(golden, "B") / "trace.csv").read_text() == "other"
    for key in ("C", "D"):
        pack_golden(golden / "A", golden, key)
        folders.output_folder(golden, key)
    assert not first.exists()
    assert len(list(scratch.iterdir())) == 2
    del folders
    assert list(scratch.iterdir()) == []


@pytest.mark.parametrize("place", [3, 10, 40, -1])
def test_a_changed_byte_is_an_error_with_its_file(golden: Path, place: int) -> None:
    path = golden / "B.packed"
    data = bytearray(path.read_bytes())
    data[place] ^= 1
    path.write_bytes(data)
    with pytest.raises(MutatorError, match="damaged golden run") as err:
        read_golden_files(golden, "B")
    assert err.value.where == str(path)
    with pytest.raises(MutatorError, match="damaged golden run"):
        golden_output_folder(golden, "B")


def test_a_truncated_file_is_an_error(golden: Path) -> None:
    for cut in (0, 5, -3):
        (golden / "B.packed").write_bytes((golden / "B.packed").read_bytes()[:cut])
        with pytest.raises(MutatorError, match="damaged golden run"):
            read_golden_files(golden, "B")


@pytest.mark.parametrize("name", ["../out", "/etc/out", "a/../../out", ""])
def test_a_forged_name_writes_nothing_outside(golden: Path, name: str) -> None:
    """A run folder can come from anybody."""
    (golden / "B.packed").write_bytes(block_bytes(0, name, pack_file(b"x")))
    with pytest.raises(MutatorError):
        golden_output_folder(golden, "B")


def test_packing_is_reproducible(golden: Path) -> None:
    before = digest((golden / "B.packed").read_bytes())
    pack_golden(golden / "A", golden, "B")
    assert digest((golden / "B.packed").read_bytes()) == before
