"""Parcels: named bytes packed together, and verified when unpacked."""

import json
from collections.abc import Mapping
from hashlib import sha256

from mutator._common.bounded_reading import MOST_JSON_BYTES
from mutator.errors import MutatorError

_MARK, _DIGEST, _LENGTH = b"FIP1", 32, 4


def pack(parts: Mapping[str, bytes]) -> bytes:
    """Pack parts. The same parts in the same order result in the same bytes."""
    head = json.dumps([[name, len(data)] for name, data in parts.items()]).encode()
    body = b"".join((len(head).to_bytes(_LENGTH, "little"), head, *parts.values()))
    return b"".join((_MARK, sha256(body).digest(), body))


def unpack(data: bytes) -> dict[str, bytes]:
    """Unpack a parcel; MutatorError if it is damaged."""
    begin = len(_MARK) + _DIGEST
    view = memoryview(data)
    if data[: len(_MARK)] != _MARK or sha256(view[begin:]).digest() != data[len(_MARK) : begin]:
        raise _damaged(data)
    end = begin + _LENGTH + int.from_bytes(data[begin : begin + _LENGTH], "little")
    parts = {}
    for name, length in _head(data, begin + _LENGTH, end):
        parts[name] = bytes(view[end : end + length])
        end += length
    return parts


def _head(data: bytes, begin: int, end: int) -> list[tuple[str, int]]:
    """Return the names and lengths of a parcel's parts, which begin at `end`."""
    if end - begin > MOST_JSON_BYTES:
        raise _damaged(data)
    try:
        head = [(str(name), int(length)) for name, length in json.loads(data[begin:end])]
    except (ValueError, TypeError, RecursionError):
        raise _damaged(data) from None
    names, lengths = [name for name, _ in head], [length for _, length in head]
    if len({*names}) < len(names) or min(lengths, default=0) < 0 or end + sum(lengths) != len(data):
        raise _damaged(data)
    return head


def _damaged(data: bytes) -> MutatorError:
    return MutatorError(
        f"a damaged parcel of {len(data)} bytes",
        expected="the bytes that were sent",
        remedy="check the network, then run the same command",
    )
