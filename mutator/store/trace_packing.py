"""The packed form of an output file of a golden run: exact, and a seventh of the size of a trace.

Steps of a drive change little from one to the next. So each array of numbers in an uncompressed .npz file is
replaced by its differences over time, taken as often as makes them smallest, in byte planes. What is between
the arrays stays as it is. Files of other forms have no arrays. The result is compressed by LZMA; see
docs/reference/formats.md.
"""

import json
import lzma
import struct
import zipfile
from collections.abc import Iterator
from io import BytesIO
from typing import NamedTuple

import numpy as np

from mutator._common.bounded_reading import MOST_FILE_BYTES
from mutator._common.hashing import canonical_json

_LENGTH_STRUCT = struct.Struct("<I")
_LZMA_PRESET = 1  # gives two percent more bytes than the default, in a third of the time
_MOST_UNPACKING_BYTES = 64_000_000  # of memory, besides the result; a forged head can claim gigabytes
_MOST_DIFFERENCES = 5  # more give less than a percent
_NUMBER_TYPES = ("<f8", "<f4", "<i8", "<i4")
_ENTRY_HEAD_STRUCT = struct.Struct("<26xHH")  # of a file in a zip archive: lengths of name and extra field
_DECODE_ERRORS = (ValueError, LookupError, TypeError, AttributeError, RecursionError)


class _Array(NamedTuple):
    """An array in a file: where its bytes begin, type, number of values, and how often differences are
    taken.
    """

    offset: int
    number_type: str
    length: int
    order: int = 0

    @property
    def end(self) -> int:
        return self.offset + self.length * np.dtype(self.number_type).itemsize


def pack_file(data: bytes) -> bytes:
    """Return the packed form of a file's bytes. It can depend on the version of liblzma."""
    arrays, planes, frame, at = [], [], [], 0
    for array in _arrays_in_npz(data):
        numbers = _ordered_integers(np.frombuffer(data, array.number_type, array.length, array.offset).copy())
        order, differences = _smallest_differences(numbers)
        arrays.append(array._replace(order=order))
        planes.append(differences.view(np.uint8).reshape(array.length, -1).T.tobytes())
        frame.append(data[at : array.offset])
        at = array.end
    text = canonical_json(arrays).encode()
    raw = b"".join((_LENGTH_STRUCT.pack(len(text)), text, *planes, *frame, data[at:]))
    return lzma.compress(raw, preset=_LZMA_PRESET)


def unpack_file(packed: bytes) -> bytes:
    """Return the bytes that `pack_file` has packed. ValueError if `packed` is damaged."""
    try:
        unpacker = lzma.LZMADecompressor(lzma.FORMAT_XZ, _MOST_UNPACKING_BYTES)
        raw = unpacker.decompress(packed, MOST_FILE_BYTES)
        if not unpacker.eof or unpacker.unused_data:
            raise ValueError("incomplete, too large, or with other data after it")
        return _unpack_decompressed(raw)
    except (*_DECODE_ERRORS, struct.error, lzma.LZMAError, EOFError) as err:
        raise ValueError(f"not a packed file ({err})") from None


def _unpack_decompressed(raw: bytes) -> bytes:
    (length,) = _LENGTH_STRUCT.unpack_from(raw)
    at = _LENGTH_STRUCT.size + length
    arrays = [_Array(*values) for values in json.loads(raw[_LENGTH_STRUCT.size : at])]
    frame_begin = at + sum(array.end - array.offset for array in arrays)
    parts, end = [], 0
    for array in arrays:
        if array.number_type not in _NUMBER_TYPES or not 0 <= array.order <= _MOST_DIFFERENCES:
            raise ValueError(f"an array of {array.number_type}, differences {array.order}")
        if array.offset < end or array.length < 0:
            raise ValueError("arrays that overlap")
        parts.append(raw[frame_begin : frame_begin + array.offset - end])
        frame_begin += array.offset - end
        size = np.dtype(array.number_type).itemsize
        planes = np.frombuffer(raw, np.uint8, array.length * size, at).reshape(size, array.length)
        at += array.length * size
        numbers = _numbers_of_words(planes.T.copy().view(f"<i{size}").reshape(-1), array.order)
        parts.append(_ordered_integers(numbers).tobytes())
        end = array.end
    return b"".join((*parts, raw[frame_begin:]))


def _arrays_in_npz(data: bytes) -> Iterator[_Array]:
    """Yield the arrays of an uncompressed .npz file by place; none for any other file."""
    try:
        with zipfile.ZipFile(BytesIO(data)) as archive:
            entries = sorted(archive.infolist(), key=lambda entry: entry.header_offset)
        arrays = [array for entry in entries if (array := _array_of_entry(data, entry))]
    except Exception:  # a target can write anything, so readers can fail in many ways
        return
    end = 0
    for array in arrays:
        if array.length and end <= array.offset and array.end <= len(data):
            yield array
            end = array.end


def _array_of_entry(data: bytes, entry: zipfile.ZipInfo) -> _Array | None:
    if entry.compress_type != zipfile.ZIP_STORED or not entry.filename.endswith(".npy"):
        return None
    name_length, extra_length = _ENTRY_HEAD_STRUCT.unpack_from(data, entry.header_offset)
    begin = entry.header_offset + _ENTRY_HEAD_STRUCT.size + name_length + extra_length
    file = BytesIO(data[begin : begin + entry.file_size])
    version = np.lib.format.read_magic(file)
    if version != (1, 0):
        return None
    shape, _, number_type = np.lib.format.read_array_header_1_0(file)
    if number_type.str not in _NUMBER_TYPES:
        return None
    return _Array(begin + file.tell(), number_type.str, int(np.prod(shape, dtype=np.int64)))


def _ordered_integers(values: np.ndarray) -> np.ndarray:
    """Map floats to integers in the same order, so that neighbouring floats differ by 1; and back, because
    the mapping is its own inverse.
    """
    words = values.view(f"<i{values.dtype.itemsize}")
    bits = words.dtype.itemsize * 8 - 1
    ordered: np.ndarray = words ^ ((words >> bits) & words.dtype.type(2**bits - 1))
    return ordered


def _smallest_differences(numbers: np.ndarray) -> tuple[int, np.ndarray]:
    """Return how often differences must be taken, so that the numbers are smallest, and these as words."""
    zero = numbers.dtype.type(0)
    candidates = [numbers]
    for _ in range(_MOST_DIFFERENCES):
        candidates.append(np.diff(candidates[-1], prepend=zero))
    words = [_words_of_numbers(candidate) for candidate in candidates]
    # exponents are bit lengths, and their sums are exact
    bits = [int(np.frexp(word.astype(float))[1].sum()) for word in words]
    order = bits.index(min(bits))
    return order, words[order]


def _words_of_numbers(numbers: np.ndarray) -> np.ndarray:
    """Return unsigned words that are small for small numbers of either sign."""
    words = (numbers << 1) ^ (numbers >> (numbers.dtype.itemsize * 8 - 1))
    unsigned: np.ndarray = words.view(f"<u{numbers.dtype.itemsize}")
    return unsigned


def _numbers_of_words(words: np.ndarray, order: int) -> np.ndarray:
    unsigned = words.view(f"<u{words.dtype.itemsize}")
    numbers = (unsigned >> 1).view(words.dtype) ^ -(words & 1)
    for _ in range(order):
        numbers = numbers.cumsum(dtype=words.dtype)
    result: np.ndarray = numbers
    return result
