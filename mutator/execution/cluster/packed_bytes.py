"""Parcels: named bytes packed together, and verified when unpacked."""

import json
from collections.abc import Mapping
from hashlib import sha256

from mutator._common.bounded_reading import MOST_JSON_BYTES
from mutator.errors import MutatorError

# begins every parcel, with the version of the format; then a SHA-256, then the length of the head
_PARCEL_MARK, _DIGEST_BYTES, _LENGTH_BYTES = b"FIP1", 32, 4


def pack_parcel(parts: Mapping[str, bytes]) -> bytes:
    """Pack parts. The same parts in the same order result in the same bytes."""
    head = json.dumps([[name, len(data)] for name, data in parts.items()]).encode()
    body = b"".join((len(head).to_bytes(_LENGTH_BYTES, "little"), head, *parts.values()))
    return b"".join((_PARCEL_MARK, sha256(body).digest(), body))


def unpack_parcel(data: bytes) -> dict[str, bytes]:
    """Unpack a parcel; MutatorError if it is damaged."""
    begin = len(_PARCEL_MARK) + _DIGEST_BYTES
    view = memoryview(data)
    if (
        data[: len(_PARCEL_MARK)] != _PARCEL_MARK
        or sha256(view[begin:]).digest() != data[len(_PARCEL_MARK) : begin]
    ):
        raise _damaged_parcel_error(data)
    end = begin + _LENGTH_BYTES + int.from_bytes(data[begin : begin + _LENGTH_BYTES], "little")
    parts = {}
    for name, length in _parse_head(data, begin + _LENGTH_BYTES, end):
        parts[name] = bytes(view[end : end + length])
        end += length
    return parts


def _parse_head(data: bytes, begin: int, end: int) -> list[tuple[str, int]]:
    """Return the names and lengths of a parcel's parts, which begin at `end`."""
    if end - begin > MOST_JSON_BYTES:
        raise _damaged_parcel_error(data)
    try:
        head = [(str(name), int(length)) for name, length in json.loads(data[begin:end])]
    except (ValueError, TypeError, RecursionError):
        raise _damaged_parcel_error(data) from None
    names, lengths = [name for name, _ in head], [length for _, length in head]
    if len({*names}) < len(names) or min(lengths, default=0) < 0 or end + sum(lengths) != len(data):
        raise _damaged_parcel_error(data)
    return head


def _damaged_parcel_error(data: bytes) -> MutatorError:
    return MutatorError(
        f"a damaged parcel of {len(data)} bytes",
        expected="the bytes that were sent",
        remedy="check the network, then run the same command",
    )
