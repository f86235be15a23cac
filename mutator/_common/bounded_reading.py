"""Read files, and unpack data, of which somebody else may have chosen the size.

A sparse file of terabytes occupies no disk, and a few bytes can unpack to gigabytes. So every reader of a
whole file has a limit, lines have a longest length, and large files must not have holes.
"""

import errno
import os
import stat
import zlib
from collections.abc import Iterator
from functools import partial
from io import BufferedReader
from pathlib import Path
from typing import BinaryIO

from mutator.errors import TooLarge

MOST_FILE_BYTES = 128_000_000  # bytes of a file that is read as a whole; a reader can have another limit
MOST_JSON_BYTES = 6_000_000  # bytes of a JSON object; as Python objects they can take 30 times as much memory
MOST_RUN_JSON_BYTES = 24_000_000  # bytes of one that grows with golden runs: 10,000 of families have 9 MB
MOST_EXPERIMENT_DATA_BYTES = 8_000_000_000  # bytes of a file that grows with the number of experiments
MOST_LINE_BYTES = 4_000_000  # bytes of a line
_NO_HOLES_FROM_BYTES = 64_000_000  # from this size, a file must not have holes
_READ_CHUNK_BYTES = 1_000_000  # at a time, so that a file that grows without end is noticed early
_GZIP_WBITS = zlib.MAX_WBITS | 16  # zlib's flag for data with a header of gzip


def read_bounded(path: Path, most_bytes: int = MOST_FILE_BYTES) -> bytes:
    """Return the content of a regular file, following links; TooLarge if it has more than `most_bytes`.

    OSError as `Path.read_bytes`, and for a pipe, socket or device (`is_no_file_error`).
    """
    with open_regular(path) as file:
        return read_open_file(file, path, most_bytes)


def open_regular(path: Path) -> BufferedReader:
    """Open a regular file for reading, without waiting for a pipe; OSError as in `read_bounded`."""
    file = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    mode = os.fstat(file).st_mode
    if stat.S_ISREG(mode):
        return os.fdopen(file, "rb")
    os.close(file)
    number = errno.EISDIR if stat.S_ISDIR(mode) else errno.ENXIO
    raise OSError(number, os.strerror(number), str(path))


def read_open_file(file: BinaryIO, where: Path, most_bytes: int = MOST_FILE_BYTES) -> bytes:
    """Return the rest of an open file; TooLarge if it has more than `most_bytes`."""
    check_file_size(file, where, most_bytes)
    remaining = os.fstat(file.fileno()).st_size - file.tell()
    data = file.read(max(remaining, 0) + 1)  # not `most_bytes`, because that many bytes would be reserved
    # a file that grows, or one that has no size, such as those in /proc
    while len(data) <= most_bytes and (more := file.read(_READ_CHUNK_BYTES)):
        data += more
    if len(data) > most_bytes:
        raise _too_large_error(len(data), where, most_bytes)
    return data


def check_file_size(file: BinaryIO, where: Path, most_bytes: int = MOST_EXPERIMENT_DATA_BYTES) -> None:
    """Raise TooLarge if an open file has more than `most_bytes`, or if it is large and has holes."""
    size = os.fstat(file.fileno()).st_size
    if size > most_bytes:
        raise _too_large_error(size, where, most_bytes)
    if size >= _NO_HOLES_FROM_BYTES and _has_hole(file.fileno(), size):
        raise TooLarge(
            f"{size:,} bytes with holes",
            where=where,
            expected="a file that occupies the disk space of its size",
            remedy="delete it, or restore it from a copy",
        )


def read_bounded_lines(file: BinaryIO, where: Path, most_bytes: int = MOST_LINE_BYTES) -> Iterator[bytes]:
    """Yield the lines of an open file, with their newlines; TooLarge for a line of more than `most_bytes`."""
    check_file_size(file, where)
    for number, line in enumerate(iter(partial(file.readline, most_bytes + 1), b""), start=1):
        if len(line) > most_bytes:
            raise TooLarge(
                f"a line of more than {most_bytes:,} bytes",
                where=where,
                line=number,
                expected="shorter lines",
                remedy="restore the file from a copy",
            )
        yield line


def decompress_bounded(data: bytes, most_bytes: int, dictionary: bytes = b"", *, gzip: bool = False) -> bytes:
    """Return what zlib (or gzip) data unpacks to. ValueError if that is more than `most_bytes`.

    zlib.error for damaged or incomplete data.
    """
    unpacker = zlib.decompressobj(_GZIP_WBITS if gzip else zlib.MAX_WBITS, zdict=dictionary)
    content = unpacker.decompress(data, most_bytes + 1)
    if len(content) > most_bytes:
        raise ValueError(f"unpacks to more than {most_bytes} bytes")
    if not unpacker.eof or (gzip and unpacker.unused_data):
        raise zlib.error("incomplete data")
    return content


def _has_hole(file: int, size: int) -> bool:
    """Return whether a file has a hole; file systems without holes report one at the end."""
    position = os.lseek(file, 0, os.SEEK_CUR)
    try:
        return os.lseek(file, 0, os.SEEK_HOLE) < size
    except OSError:
        return False
    finally:
        os.lseek(file, position, os.SEEK_SET)


def _too_large_error(size: int, where: Path, most_bytes: int) -> TooLarge:
    return TooLarge(
        f"{size:,} bytes",
        where=where,
        expected=f"at most {most_bytes:,} bytes",
        remedy="shorten or split it, or delete it if it does not belong here",
    )
