"""Reads traces in MCAP files with JSON messages, without trusting the sizes that a file claims."""

import json
import struct
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from mutator._common.bounded_reading import MOST_FILE_BYTES, MOST_JSON_BYTES, read_bounded
from mutator.errors import BadTrace

_MAGIC = b"\x89MCAP0\r\n"
_CHANNEL, _MESSAGE, _CHUNK = 4, 5, 6  # kinds of records; others are skipped
_MOST_RECORDS = 300_000
_RECORD = struct.Struct("<BQ")  # kind, size of the content
_MESSAGE_HEAD = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time
_CHUNK_HEAD = struct.Struct("<QQQI")  # first and last time, size when unpacked, checksum
_SIZE = struct.Struct("<Q")

Values = tuple[list[float], dict[str, list[Any]]]  # times in s, and the values of each field


def read_topics(path: Path, fields: Mapping[str, Iterable[str]]) -> dict[str, Values]:
    """Return the messages' log times, and the values of fields such as `state.gap`, of each topic.

    Messages are in the order of their times. BadTrace for a file that exceeds a limit, or with another
    content; KeyError for a missing field. Other errors of damaged content are not caught.
    """
    data = read_bounded(path, MOST_FILE_BYTES)
    if len(data) < 2 * len(_MAGIC) or not (data.startswith(_MAGIC) and data.endswith(_MAGIC)):
        raise BadTrace("no beginning or no end of an .mcap file", "a complete .mcap file")
    topics: dict[int, str] = {}
    found: dict[str, list[tuple[int, list[Any]]]] = {topic: [] for topic in fields}
    for kind, body in _Records().of_file(memoryview(data)[len(_MAGIC) : -len(_MAGIC)]):
        if kind == _CHANNEL:
            topic, encoding = _texts(body[4:])
            topics[int.from_bytes(body[:2], "little")] = topic
            if topic in fields and encoding != "json":
                raise BadTrace(f"{encoding[:40]} messages in {topic}", "JSON messages")
        elif kind == _MESSAGE:
            channel, _, log_time, _ = _MESSAGE_HEAD.unpack_from(body)
            topic = topics[channel]
            if topic in fields:
                found[topic].append((log_time, _numbers(body[_MESSAGE_HEAD.size :], topic, fields[topic])))
    return {topic: _columns(rows, fields[topic]) for topic, rows in found.items()}


class _Records:
    """The records of a file, also of its chunks. They are counted, and so are the bytes of all chunks."""

    def __init__(self) -> None:
        self._count = self._bytes = 0

    def of_file(self, data: memoryview) -> Iterator[tuple[int, memoryview]]:
        for kind, body in self._split(data):
            if kind == _CHUNK:
                yield from self._split(self._unpacked(body))
            else:
                yield kind, body

    def _split(self, data: memoryview) -> Iterator[tuple[int, memoryview]]:
        at = 0
        while at < len(data):
            kind, size = _RECORD.unpack_from(data, at)
            at += _RECORD.size + size
            self._count += 1
            if self._count > _MOST_RECORDS:
                raise BadTrace(f"more than {_MOST_RECORDS:,} records", "fewer messages")
            if at > len(data):
                raise BadTrace("a record that is cut off", "a complete .mcap file")
            yield kind, data[at - size : at]

    def _unpacked(self, chunk: memoryview) -> memoryview:
        """Return the records of a chunk, unpacked to the size that the chunk itself claims and no further."""
        _, _, size, _ = _CHUNK_HEAD.unpack_from(chunk)
        (compression,) = _texts(chunk[_CHUNK_HEAD.size :], 1)
        content = chunk[_CHUNK_HEAD.size + 4 + len(compression.encode()) :]
        (packed,) = _SIZE.unpack_from(content)
        self._bytes += size
        if self._bytes > MOST_FILE_BYTES:
            raise BadTrace(f"{self._bytes:,} bytes when unpacked", f"at most {MOST_FILE_BYTES:,}")
        data = _decompressed(content[_SIZE.size : _SIZE.size + packed], compression, size + 1)
        if len(data) != size:
            raise BadTrace("a chunk that unpacks to another size than it claims", f"{size:,} bytes")
        return memoryview(data)


def _decompressed(data: memoryview, compression: str, most: int) -> bytes | memoryview:
    if not compression:
        return data
    try:
        import lz4.frame as lz4  # type: ignore[import-untyped]
        import zstandard
    except ImportError:
        raise BadTrace("an .mcap file, but the package mcap is missing", "pip install mcap") from None
    if compression == "lz4":
        return bytes(lz4.LZ4FrameDecompressor().decompress(data, max_length=most))
    if compression == "zstd":
        return zstandard.ZstdDecompressor().stream_reader(data).read(most)
    raise BadTrace(f"the compression {compression[:40]}", "lz4, zstd or none")


def _texts(data: memoryview, count: int = 2) -> list[str]:
    """Return the first texts in `data`; each follows its size."""
    texts, at = [], 0
    for _ in range(count):
        end = at + 4 + int.from_bytes(data[at : at + 4], "little")
        texts.append(str(data[at + 4 : end], "utf-8"))
        at = end
    return texts


def _numbers(message: memoryview, topic: str, fields: Iterable[str]) -> list[Any]:
    if len(message) > MOST_JSON_BYTES:
        raise BadTrace(f"a message of {len(message):,} bytes in {topic}", f"at most {MOST_JSON_BYTES:,}")
    data = json.loads(bytes(message))
    values = [_field(data, field) for field in fields]
    for field, value in zip(fields, values, strict=True):
        if not isinstance(value, int | float):
            raise BadTrace(f"{topic}:{field} is not numeric", "a number in each message")
    return values


def _field(data: Any, path: str) -> Any:
    for key in path.split("."):
        data = data[key]
    return data


def _columns(rows: list[tuple[int, list[Any]]], fields: Iterable[str]) -> Values:
    rows.sort(key=lambda row: row[0])
    columns = {field: [values[at] for _, values in rows] for at, field in enumerate(fields)}
    return [time / 1e9 for time, _ in rows], columns
