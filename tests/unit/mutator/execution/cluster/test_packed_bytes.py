"""Data sent between the command and its workers arrives unchanged or is refused."""

import random
from hashlib import sha256

import pytest

from mutator.errors import MutatorError
from mutator.execution.cluster.packed_bytes import pack_parcel, unpack_parcel
from mutator.execution.cluster.piece_messages import PieceEnding, PieceResult


def test_parts_are_read_back_in_order() -> None:
    parts = {"a": b"", "b/c": bytes(range(256)), "line": b"x\ny"}
    assert unpack_parcel(pack_parcel(parts)) == parts
    assert list(unpack_parcel(pack_parcel(parts))) == list(parts)


def test_any_damage_is_detected() -> None:
    data, draw = pack_parcel({"a": b"some bytes", "b": b"more"}), random.Random(1)
    for _ in range(100):
        at = draw.randrange(len(data))
        changed = data[:at] + bytes([data[at] ^ 1 << draw.randrange(8)]) + data[at + 1 :]
        for wrong in (changed, data[:at], data + b"x"):
            with pytest.raises(MutatorError, match="damaged parcel"):
                unpack_parcel(wrong)


@pytest.mark.parametrize(
    "head",
    [
        b"x",
        b"{}",
        b"[1]",
        b'[["a"]]',
        b'[["a", -1], ["b", 3]]',
        b'[["a", 9]]',
        b'[["a", 1], ["a", 1]]',
        b"[" * 9999,
        b'[["a", 2]]' + b" " * 6_000_000,
    ],
)
def test_a_parcel_whose_head_does_not_fit_is_refused(head: bytes) -> None:
    """Its digest is right: somebody made it so."""
    body = len(head).to_bytes(4, "little") + head + b"xx"
    with pytest.raises(MutatorError, match="damaged parcel"):
        unpack_parcel(b"FIP1" + sha256(body).digest() + body)


def test_a_result_is_read_back_unchanged() -> None:
    result = PieceResult(
        number=7,
        ending=PieceEnding.FINISHED,
        seconds=1.5,
        needs_proof=True,
        records=(b'{"a":1}', b'{"b":"\xc3\xa4"}'),
        timings=(b"{}", b"{}"),
        patches=b"\x00\n\x01",
        series=b"\n\n",
        series_goldens=("S1", "S1+alone@2"),
    )
    assert PieceResult.from_bytes(result.to_bytes()) == result
