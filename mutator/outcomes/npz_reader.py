"""Reads .npz files with uncompressed members, as `numpy.savez` writes them (PKWARE's APPNOTE 6.3).

`numpy.load` would take longer than all other work on a trace. It is used only for unusual or damaged files.
"""

import io
from functools import lru_cache
from struct import Struct
from zlib import crc32

import numpy as np
from numpy.lib import format as npy

_END_STRUCT = Struct("<4sHHHHIIH")  # the end of the directory, which ends the file
_ENTRY_STRUCT = Struct("<4sBBHHHHHIIIHHHHHII")  # a member in the directory
_LOCAL_HEAD_STRUCT = Struct("<4sHHHHHIIIHH")  # before the bytes of a member
_NPY_MAGIC = b"\x93NUMPY\x01\x00"
# what a single array, and a member's directory entry, begin with
ARRAY_MAGIC, ENTRY_MAGIC = _NPY_MAGIC[:6], b"PK\1\2"
_BYTES_BEFORE_HEADER = len(_NPY_MAGIC) + 2  # bytes before the header of a .npy file
_ZIP64_SIZE_MARKER = 0xFFFFFFFF  # marks a size that is stored in a ZIP64 field
_MEMBER_SUFFIX = ".npy"


def read_members(data: bytes) -> dict[str, np.ndarray] | None:
    """Return the arrays of a file by name, read-only; None if the file is unusual or damaged."""
    try:
        return _read_usual_members(data)
    except Exception:  # a run can write anything; numpy then reports the error
        return None


def _read_usual_members(data: bytes) -> dict[str, np.ndarray] | None:
    if len(data) < _END_STRUCT.size:
        return None
    magic, *disks, count, total, size, begin, comment = _END_STRUCT.unpack_from(
        data, len(data) - _END_STRUCT.size
    )
    if (
        magic != b"PK\5\6"
        or any(disks)
        or count != total
        or comment
        or begin + size + _END_STRUCT.size != len(data)
    ):
        return None
    arrays: dict[str, np.ndarray] = {}
    view = memoryview(data)
    at = begin
    for _ in range(count):
        member = _read_member(data, view, at)
        if member is None:
            return None
        name, array, at = member
        arrays[name] = array
    return arrays if len(arrays) == count and at == begin + size else None


def _read_member(data: bytes, view: memoryview, at: int) -> tuple[str, np.ndarray, int] | None:
    """Return name and array of the member whose directory entry is at `at`, and the next entry's position."""
    (
        magic,
        _,
        _,
        _,
        flags,
        method,
        _,
        _,
        crc,
        packed,
        size,
        name_length,
        extra_length,
        comment_length,
        *_,
        begin,
    ) = _ENTRY_STRUCT.unpack_from(data, at)
    local, _, own_flags, own_method, *_, own_named, own_extra = _LOCAL_HEAD_STRUCT.unpack_from(data, begin)
    name = data[at + _ENTRY_STRUCT.size : at + _ENTRY_STRUCT.size + name_length]
    start = begin + _LOCAL_HEAD_STRUCT.size
    if magic != b"PK\1\2" or local != b"PK\3\4" or data[start : start + own_named] != name:
        return None
    if flags or method or own_flags or own_method or packed != size or size == _ZIP64_SIZE_MARKER:
        return None
    start += own_named + own_extra
    content = view[start : start + size]
    if len(content) != size or crc32(content) != crc or content[: len(_NPY_MAGIC)] != _NPY_MAGIC:
        return None
    head = _BYTES_BEFORE_HEADER + int.from_bytes(
        content[_BYTES_BEFORE_HEADER - 2 : _BYTES_BEFORE_HEADER], "little"
    )
    dtype, shape = _parse_header(bytes(content[_BYTES_BEFORE_HEADER - 2 : head]))
    array = np.frombuffer(content[head:], dtype=dtype).reshape(shape)
    text = name.decode("ascii")
    if not text.endswith(_MEMBER_SUFFIX):
        return None
    return (
        text.removesuffix(_MEMBER_SUFFIX),
        array,
        at + _ENTRY_STRUCT.size + name_length + extra_length + comment_length,
    )


@lru_cache(maxsize=256)  # all runs of a campaign have the same few headers
def _parse_header(text: bytes) -> tuple[np.dtype, tuple[int, ...]]:
    """Read type and shape from a .npy header. ValueError unless the array is numeric and in C order."""
    shape, fortran, dtype = npy.read_array_header_1_0(io.BytesIO(text))
    if fortran or dtype.hasobject or dtype.kind not in "biuf" or min(shape, default=0) < 0:
        raise ValueError(text)
    return dtype, shape
