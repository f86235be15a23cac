"""Packed patches, and errors for a lost one."""

from pathlib import Path

import pytest

from mutator.store.packed_patches import PatchFolder, PatchWriter


@pytest.fixture
def run(tmp_path: Path) -> Path:
    for worker, name in (("0001-gw0", "a" * 16), ("0001-gw1", "b" * 16)):
        writer = PatchWriter(tmp_path, worker)
        writer.append(name, f"patch of {name}\n".encode())
        writer.close()
    return tmp_path


def test_a_patch_is_in_the_file_of_its_worker(run: Path) -> None:
    assert PatchFolder(run).expected_file_of("a" * 16, "0002-gw7") == run / "patches" / "0001-gw0.blocks"


def test_the_error_for_a_lost_patch_names_its_file(run: Path) -> None:
    path = run / "patches" / "0001-gw1.blocks"
    data = bytearray(path.read_bytes())
    data[-1] ^= 1
    path.write_bytes(data)
    patches = PatchFolder(run)
    assert patches.read_patch("b" * 16) is None
    assert patches.expected_file_of("b" * 16) == path


def test_the_error_for_a_lost_file_takes_its_name_from_the_record(run: Path) -> None:
    path = run / "patches" / "0001-gw1.blocks"
    path.unlink()
    assert PatchFolder(run).expected_file_of("b" * 16, "0001-gw1") == path
    assert PatchFolder(run).expected_file_of("b" * 16) == run / "patches"
