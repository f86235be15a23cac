"""No file of a run folder takes long or much memory because of what it claims or unpacks to."""

import gzip
import io
import struct
import zipfile
import zlib
from pathlib import Path

import numpy as np
import pytest

from mutator._common.files import read_json
from mutator.errors import MutatorError
from mutator.outcomes.importers import npz
from mutator.outcomes.trace_files import TraceRequest
from mutator.store import series_format
from mutator.store.checksummed_blocks import block_bytes, read_blocks
from mutator.store.checksummed_lines import read_segment, verified_lines
from mutator.store.file_digests import FileDigest
from mutator.store.packed_patches import COMPLETE_BLOCK, PatchFolder
from mutator.store.plan_lines import read_plan_lines
from mutator.store.series_script import write_script
from mutator.store.time_series_folder import load_index
from tests.costs import is_cheap, is_refused

TERABYTES = 4 * 10**12


@pytest.fixture
def sparse(tmp_path: Path) -> Path:
    path = tmp_path / "records" / "1-1.jsonl"
    path.parent.mkdir()
    with path.open("wb") as file:
        file.truncate(TERABYTES)
    return path


@pytest.mark.parametrize(
    "read",
    [
        lambda path: read_segment(path),
        lambda path: list(verified_lines(path, "records/1")),
        lambda path: list(read_plan_lines(path)),
        lambda path: read_blocks(path),
        lambda path: read_json(path, "run/3"),
        FileDigest.of_file,
    ],
)
def test_a_sparse_file_is_refused_by_each_reader(sparse: Path, read: object) -> None:
    assert "4,000,000,000,000 bytes" in is_refused(lambda: read(sparse))  # type: ignore[operator]


def test_bytes_that_look_like_many_long_blocks_are_not_all_verified(tmp_path: Path) -> None:
    head = struct.pack("<4sBHI", b"FIB1", 0, 0, 2_000_000)
    path = tmp_path / "1.blocks"
    path.write_bytes((head + bytes(8)) * 200_000 + bytes(2_000_000))
    is_cheap(lambda: read_blocks(path))
    assert read_blocks(path).is_damaged


def test_blocks_between_damaged_parts_are_still_read(tmp_path: Path) -> None:
    block = block_bytes(0, "key", b"data")
    path = tmp_path / "1.blocks"
    path.write_bytes((block + b"damage") * 1000)
    is_cheap(lambda: read_blocks(path))
    assert len(read_blocks(path).blocks) == 1000


def test_a_patch_that_unpacks_to_too_much_is_damaged(tmp_path: Path) -> None:
    packer = zlib.compressobj(9)
    data = b"".join(packer.compress(bytes(10**6)) for _ in range(100)) + packer.flush()
    (tmp_path / "patches").mkdir()
    (tmp_path / "patches" / "1-1.blocks").write_bytes(block_bytes(COMPLETE_BLOCK, "a" * 16, data))
    is_cheap(lambda: PatchFolder(tmp_path).read_patch("a" * 16))
    assert PatchFolder(tmp_path).read_patch("a" * 16) is None


def test_series_that_unpack_to_too_much_or_claim_many_values_are_damaged() -> None:
    is_refused(lambda: series_format.decode_series(gzip.compress(bytes(100_000_000), 1)))
    times = np.arange(100_000.0).tobytes()
    head = b'{"known":0,"more":100000,"changed":[],"points":[],"every":[' + b"1," * 99_999 + b"1]}"
    is_refused(
        lambda: series_format.decode_series(gzip.compress(struct.pack("<I", len(head)) + head + times))
    )
    deep = b"[" * 100_000
    is_refused(lambda: series_format.decode_series(gzip.compress(struct.pack("<I", len(deep)) + deep)))


def test_an_index_of_series_does_not_unpack_to_too_much(tmp_path: Path) -> None:
    write_script(tmp_path / "index.js", gzip.compress(b"[" + b"0," * 20_000_000, 1))
    assert "a damaged index" in is_refused(lambda: load_index(tmp_path / "index.js"))


def _zip(size: int, shape: int) -> bytes:
    with (
        zipfile.ZipFile(data := io.BytesIO(), "w", zipfile.ZIP_DEFLATED) as file,
        file.open("t.npy", "w") as one,
    ):
        np.lib.format.write_array_header_1_0(one, {"descr": "<f8", "fortran_order": False, "shape": (shape,)})
        for _ in range(size // 10**6):
            one.write(bytes(10**6))
    return data.getvalue()


@pytest.mark.parametrize(("size", "shape"), [(150_000_000, 18_000_000), (0, 10**9), (0, 10**15)])
def test_a_trace_that_unpacks_to_too_much_is_refused(tmp_path: Path, size: int, shape: int) -> None:
    (tmp_path / "trace.npz").write_bytes(_zip(size, shape))

    def read() -> None:
        path = tmp_path / "trace.npz"
        request = TraceRequest(path=path, time_channel="t", channels=(), everything=True)
        try:
            npz.IMPORTER.read(request)
        except (ValueError, MemoryError) as error:  # as `load_trace`
            raise MutatorError("refused") from error

    is_refused(read)
