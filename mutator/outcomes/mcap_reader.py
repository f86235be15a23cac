"""Reads traces in MCAP files with JSON messages, without trusting the sizes that a file claims."""

import json
import struct
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from mutator._common.bounded_reading import MOST_FILE_BYTES, MOST_JSON_BYTES, read_bounded
from mutator.errors import BadTrace

_FILE_MAGIC = b"\x89MCAP0\r\n"
_CHANNEL_RECORD, _MESSAGE_RECORD, _CHUNK_RECORD = 4, 5, 6  # kinds of records; others are skipped
_MOST_RECORDS = 300_000  # bounds the time that a file of tiny records takes
_RECORD_HEAD_STRUCT = struct.Struct("<BQ")  # kind, size of the content
_MESSAGE_HEAD_STRUCT = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time
_CHUNK_HEAD_STRUCT = struct.Struct("<QQQI")  # first and last time, size when unpacked, checksum
_SIZE_STRUCT = struct.Struct("<Q")

TimedValues = tuple[list[float], dict[str, list[Any]]]  # times in s, and the values of each field


def read_topics(path: Path, fields: Mapping[str, Iterable[str]]) -> dict[str, TimedValues]:
    """Return the messages' log times, and the values of fields such as `state.gap`, of each topic.

    Messages are in the order of their times. BadTrace for a file that exceeds a limit, or with another
    content; KeyError for a missing field. Other errors of damaged content are not caught.
    """
    data = read_bounded(path, MOST_FILE_BYTES)
    if len(data) < 2 * len(_FILE_MAGIC) or not (data.startswith(_FILE_MAGIC) and data.endswith(_FILE_MAGIC)):
        raise BadTrace("no beginning or no end of an .mcap file", "a complete .mcap file")
    topics: dict[int, str] = {}
    messages_by_topic: dict[str, list[tuple[int, list[Any]]]] = {topic: [] for topic in fields}
    for kind, body in _RecordReader().records_in(memoryview(data)[len(_FILE_MAGIC) : -len(_FILE_MAGIC)]):
        if kind == _CHANNEL_RECORD:
            topic, encoding = _parse_texts(body[4:])
            topics[int.from_bytes(body[:2], "little")] = topic
            if topic in fields and encoding != "json":
                raise BadTrace(f"{encoding[:40]} messages in {topic}", "JSON messages")
        elif kind == _MESSAGE_RECORD:
            channel, _, log_time, _ = _MESSAGE_HEAD_STRUCT.unpack_from(body)
            topic = topics[channel]
            if topic in fields:
                messages_by_topic[topic].append(
                    (log_time, _parse_numbers(body[_MESSAGE_HEAD_STRUCT.size :], topic, fields[topic]))
                )
    return {topic: _timed_columns(rows, fields[topic]) for topic, rows in messages_by_topic.items()}


class _RecordReader:
    """The records of a file, also of its chunks. They are counted, and so are the bytes of all chunks."""

    def __init__(self) -> None:
        self._count = self._unpacked_bytes = 0

    def records_in(self, data: memoryview) -> Iterator[tuple[int, memoryview]]:
        for kind, body in self._split_records(data):
            if kind == _CHUNK_RECORD:
                yield from self._split_records(self._unpack_chunk(body))
            else:
                yield kind, body

    def _split_records(self, data: memoryview) -> Iterator[tuple[int, memoryview]]:
        at = 0
        while at < len(data):
            kind, size = _RECORD_HEAD_STRUCT.unpack_from(data, at)
            at += _RECORD_HEAD_STRUCT.size + size
            self._count += 1
            if self._count > _MOST_RECORDS:
                raise BadTrace(f"more than {_MOST_RECORDS:,} records", "fewer messages")
            if at > len(data):
                raise BadTrace("a record that is cut off", "a complete .mcap file")
            yield kind, data[at - size : at]

    def _unpack_chunk(self, chunk: memoryview) -> memoryview:
        """Return the records of a chunk, unpacked to the size that the chunk itself claims and no further."""
        _, _, size, _ = _CHUNK_HEAD_STRUCT.unpack_from(chunk)
        (compression,) = _parse_texts(chunk[_CHUNK_HEAD_STRUCT.size :], 1)
        content = chunk[_CHUNK_HEAD_STRUCT.size + 4 + len(compression.encode()) :]
        (packed,) = _SIZE_STRUCT.unpack_from(content)
        self._unpacked_bytes += size
        if self._unpacked_bytes > MOST_FILE_BYTES:
            raise BadTrace(f"{self._unpacked_bytes:,} bytes when unpacked", f"at most {MOST_FILE_BYTES:,}")
        data = _decompress(content[_SIZE_STRUCT.size : _SIZE_STRUCT.size + packed], compression, size + 1)
        if len(data) != size:
            raise BadTrace("a chunk that unpacks to another size than it claims", f"{size:,} bytes")
        return memoryview(data)


def _decompress(data: memoryview, compression: str, most_bytes: int) -> bytes | memoryview:
    if not compression:
        return data
    try:
        import lz4.frame as lz4  # type: ignore[import-untyped]
        import zstandard
    except ImportError:
        raise BadTrace("an .mcap file, but the package mcap is missing", "pip install mcap") from None
    if compression == "lz4":
        return bytes(lz4.LZ4FrameDecompressor().decompress(data, max_length=most_bytes))
    if compression == "zstd":
        return zstandard.ZstdDecompressor().stream_reader(data).read(most_bytes)
    raise BadTrace(f"the compression {compression[:40]}", "lz4, zstd or none")


def _parse_texts(data: memoryview, count: int = 2) -> list[str]:
    """Return the first texts in `data`; each follows its size."""
    texts, at = [], 0
    for _ in range(count):
        end = at + 4 + int.from_bytes(data[at : at + 4], "little")
        texts.append(str(data[at + 4 : end], "utf-8"))
        at = end
    return texts


def _parse_numbers(message: memoryview, topic: str, fields: Iterable[str]) -> list[Any]:
    if len(message) > MOST_JSON_BYTES:
        raise BadTrace(f"a message of {len(message):,} bytes in {topic}", f"at most {MOST_JSON_BYTES:,}")
    data = json.loads(bytes(message))
    values = [_field_value(data, field) for field in fields]
    for field, value in zip(fields, values, strict=True):
        if not isinstance(value, int | float):
            raise BadTrace(f"{topic}:{field} is not numeric", "a number in each message")
    return values


def _field_value(data: Any, path: str) -> Any:
    for key in path.split("."):
        data = data[key]
    return data


def _timed_columns(rows: list[tuple[int, list[Any]]], fields: Iterable[str]) -> TimedValues:
    rows.sort(key=lambda row: row[0])
    columns = {field: [values[at] for _, values in rows] for at, field in enumerate(fields)}
    return [time / 1e9 for time, _ in rows], columns
