"""Reads .npz files with uncompressed members, as `numpy.savez` writes them (PKWARE's APPNOTE 6.3).

`numpy.load` would take longer than all other work on a trace. It is used only for unusual or damaged files.
"""

import io
from functools import lru_cache
from struct import Struct
from zlib import crc32

import numpy as np
from numpy.lib import format as npy

_END = Struct("<4sHHHHIIH")
_ENTRY = Struct("<4sBBHHHHHIIIHHHHHII")
_LOCAL = Struct("<4sHHHHHIIIHH")
_MAGIC = b"\x93NUMPY\x01\x00"
ARRAY, ENTRY = _MAGIC[:6], b"PK\1\2"  # what a single array, and a member's directory entry, begin with
_BEFORE = len(_MAGIC) + 2  # bytes before the header of a .npy file
_IN_EXTRA = 0xFFFFFFFF  # marks a size that is stored in a ZIP64 field
_NAME = ".npy"


def members(data: bytes) -> dict[str, np.ndarray] | None:
    """Return the arrays of a file by name, read-only; None if the file is unusual or damaged."""
    try:
        return _members(data)
    except Exception:  # a run can write anything; numpy then reports the error
        return None


def _members(data: bytes) -> dict[str, np.ndarray] | None:
    if len(data) < _END.size:
        return None
    magic, *disks, count, total, size, begin, comment = _END.unpack_from(data, len(data) - _END.size)
    if magic != b"PK\5\6" or any(disks) or count != total or comment or begin + size + _END.size != len(data):
        return None
    found: dict[str, np.ndarray] = {}
    view = memoryview(data)
    at = begin
    for _ in range(count):
        one = _member(data, view, at)
        if one is None:
            return None
        name, array, at = one
        found[name] = array
    return found if len(found) == count and at == begin + size else None


def _member(data: bytes, view: memoryview, at: int) -> tuple[str, np.ndarray, int] | None:
    """Return name and array of the member whose directory entry is at `at`, and the next entry's position."""
    (magic, _, _, _, flags, method, _, _, crc, packed, size, named, extra, comment, *_, begin) = (
        _ENTRY.unpack_from(data, at)
    )
    local, _, own_flags, own_method, *_, own_named, own_extra = _LOCAL.unpack_from(data, begin)
    name = data[at + _ENTRY.size : at + _ENTRY.size + named]
    start = begin + _LOCAL.size
    if magic != b"PK\1\2" or local != b"PK\3\4" or data[start : start + own_named] != name:
        return None
    if flags or method or own_flags or own_method or packed != size or size == _IN_EXTRA:
        return None
    start += own_named + own_extra
    inside = view[start : start + size]
    if len(inside) != size or crc32(inside) != crc or inside[: len(_MAGIC)] != _MAGIC:
        return None
    head = _BEFORE + int.from_bytes(inside[_BEFORE - 2 : _BEFORE], "little")
    dtype, shape = _header(bytes(inside[_BEFORE - 2 : head]))
    array = np.frombuffer(inside[head:], dtype=dtype).reshape(shape)
    text = name.decode("ascii")
    if not text.endswith(_NAME):
        return None
    return text.removesuffix(_NAME), array, at + _ENTRY.size + named + extra + comment


@lru_cache(maxsize=256)
def _header(text: bytes) -> tuple[np.dtype, tuple[int, ...]]:
    """Read type and shape from a .npy header. ValueError unless the array is numeric and in C order."""
    shape, fortran, dtype = npy.read_array_header_1_0(io.BytesIO(text))
    if fortran or dtype.hasobject or dtype.kind not in "biuf" or min(shape, default=0) < 0:
        raise ValueError(text)
    return dtype, shape
