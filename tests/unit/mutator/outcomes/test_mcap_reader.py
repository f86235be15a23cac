"""An MCAP file is unpacked within limits, whatever sizes its chunks, its index and its summary claim."""

import struct
from collections.abc import Callable
from pathlib import Path

import pytest

from mutator.errors import MutatorError
from mutator.outcomes.importers import mcap
from mutator.outcomes.trace_files import TraceRequest
from mutator.targets.channels import Channel
from tests.costs import is_refused

lz4 = pytest.importorskip("lz4.frame")
zstandard = pytest.importorskip("zstandard")

MAGIC = b"\x89MCAP0\r\n"
MESSAGE = b'{"gap": 2.5, "force": 1}'
PACK: dict[str, Callable[[bytes], bytes]] = {"": bytes, "lz4": lz4.compress, "zstd": zstandard.compress}


def record(kind: int, content: bytes) -> bytes:
    return struct.pack("<BQ", kind, len(content)) + content


def text(value: str) -> bytes:
    return struct.pack("<I", len(value)) + value.encode()


def message(t: float, data: bytes = MESSAGE, channel: int = 1) -> bytes:
    return record(5, struct.pack("<HIQQ", channel, 0, int(t * 1e9), 0) + data)


def chunk(content: bytes, compression: str) -> bytes:
    return packed_chunk(PACK[compression](content), compression, len(content))


def packed_chunk(data: bytes, compression: str, size: int) -> bytes:
    head = struct.pack("<QQQI", 0, 0, size, 0) + text(compression)
    return record(6, head + struct.pack("<Q", len(data)) + data)


def zeros(mb: int, compression: str) -> bytes:
    if compression == "zstd":
        packer = zstandard.ZstdCompressor().compressobj()
        return b"".join(packer.compress(bytes(10**6)) for _ in range(mb)) + bytes(packer.flush())
    packer = lz4.LZ4FrameCompressor()
    return bytes(packer.begin() + b"".join(packer.compress(bytes(10**6)) for _ in range(mb)) + packer.flush())


def complete(*records: bytes, encoding: str = "json") -> bytes:
    """A file without a summary."""
    channel = record(4, struct.pack("<HH", 1, 0) + text("/cart") + text(encoding) + struct.pack("<I", 0))
    footer = record(2, struct.pack("<QQI", 0, 0, 0))
    return MAGIC + record(1, text("") + text("")) + channel + b"".join(records) + footer + MAGIC


def read(path: Path, *records: bytes, **other: str) -> dict[str, list[float]]:
    """Read channel `gap` as `load_trace` does."""
    path.write_bytes(complete(*records, **other))
    channel = Channel(name="gap", unit="m", other_trace_name="/cart:gap")
    try:
        found = mcap.IMPORTER.read(TraceRequest(path=path, time_channel="/cart", channels=[channel]))
    except (ValueError, MemoryError, EOFError) as error:
        raise MutatorError(str(error)) from None
    return {name: values.tolist() for name, values in found.items()}


@pytest.mark.parametrize("compression", PACK)
def test_messages_are_read_in_the_order_of_their_times(tmp_path: Path, compression: str) -> None:
    later = chunk(message(2.0) + message(3.0, b'{"gap": true}'), compression)
    found = read(tmp_path / "a.mcap", later, chunk(message(1.0), compression), message(0.0))
    assert found == {"/cart": [0.0, 1.0, 2.0, 3.0], "gap": [2.5, 2.5, 2.5, 1.0]}


@pytest.mark.parametrize("compression", ["lz4", "zstd"])
def test_a_chunk_is_unpacked_to_the_size_that_it_claims(tmp_path: Path, compression: str) -> None:
    bomb = zeros(300, compression)
    for claimed in (100, 50_000_000, 300_000_000):
        content = packed_chunk(bomb, compression, claimed)
        assert "unpack" in is_refused(lambda content=content: read(tmp_path / "a.mcap", content))  # type: ignore[misc]


def test_many_small_chunks_share_a_limit(tmp_path: Path) -> None:
    one = chunk(message(0.0, b'{"gap": 1' + b" " * 5_000_000 + b"}"), "zstd")
    assert "bytes when unpacked" in is_refused(lambda: read(tmp_path / "a.mcap", *[one] * 40))


@pytest.mark.parametrize(
    "content",
    [
        chunk(message(0.0, b'{"gap":1}') * 350_000, "zstd"),
        chunk(record(99, b"") * 1_000_000, "lz4"),
        record(99, b"") * 1_000_000,
    ],
    ids=["messages", "records of a chunk", "records"],
)
def test_records_are_counted(tmp_path: Path, content: bytes) -> None:
    assert "more than 300,000 records" in is_refused(lambda: read(tmp_path / "a.mcap", content))


@pytest.mark.parametrize(
    ("content", "got"),
    [
        (message(0.0, b'{"gap": "' + b"x" * 5_000_000 + b'"}') + message(1.0) * 1000, "gap is not numeric"),
        (message(0.0, b'{"gap": 1' + b" " * 6_000_000 + b"}"), "a message of"),
        (struct.pack("<BQ", 5, 10**15), "cut off"),
        (chunk(message(0.0), "")[:40], "cut off"),
    ],
    ids=["text", "long message", "cut off", "cut off in a chunk"],
)
def test_damaged_and_odd_content_is_refused(tmp_path: Path, content: bytes, got: str) -> None:
    assert got in is_refused(lambda: read(tmp_path / "a.mcap", content))


def test_other_encodings_are_refused(tmp_path: Path) -> None:
    with pytest.raises(MutatorError, match="protobuf messages in /cart"):
        read(tmp_path / "a.mcap", message(0.0), encoding="protobuf")


def test_only_complete_files_are_read(tmp_path: Path) -> None:
    (tmp_path / "a.mcap").write_bytes(complete(message(0.0))[:-1])
    with pytest.raises(ValueError, match="no end"):
        mcap.IMPORTER.read(TraceRequest(path=tmp_path / "a.mcap", time_channel="/cart", channels=[]))
