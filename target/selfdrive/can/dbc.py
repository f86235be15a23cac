"""Reads a DBC file into bit layouts that packing and parsing can use without looking anything up.

A message is handled as one big-endian integer of its whole payload, so a signal is a shift and a
mask. That holds for Motorola signals, the only kind the car uses; others are refused.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

import cantools

COUNTER = "COUNTER"
CHECKSUM = "CHECKSUM"


class Field(NamedTuple):
    """One signal: `raw = word >> shift & mask`, `physical = raw * factor + offset`."""

    name: str
    shift: int
    mask: int
    sign_bit: int  # 0 for unsigned
    factor: float  # int where the file says so, to keep counts whole
    offset: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Message:
    """One frame's layout. `has_checksum` implies the checksum is the low half of the last byte."""

    name: str
    address: int
    size: int  # bytes
    fields: Mapping[str, Field]
    has_checksum: bool
    counter_shift: int | None  # of the two-bit counter, None without one


@cache
def load(path: Path) -> Mapping[str, Message]:
    """All messages of a DBC file by name. Cached per process; the result is immutable."""
    database = cantools.database.load_file(path)
    return MappingProxyType({message.name: _compile(message) for message in database.messages})


def _compile(message) -> Message:
    fields = {signal.name: _field(message, signal) for signal in message.signals}
    counter, checksum = fields.get(COUNTER), fields.get(CHECKSUM)
    if checksum is not None and (checksum.shift, checksum.mask) != (0, 0xF):
        raise ValueError(f"{message.name}: the checksum must be the low half of the last byte")
    if counter is not None and counter.mask != 0x3:
        raise ValueError(f"{message.name}: the counter must have two bits")
    return Message(
        name=message.name,
        address=message.frame_id,
        size=message.length,
        fields=MappingProxyType(fields),
        has_checksum=checksum is not None,
        counter_shift=None if counter is None else counter.shift,
    )


def _field(message, signal) -> Field:
    if signal.byte_order != "big_endian":
        raise ValueError(f"{message.name}.{signal.name}: only big-endian signals are supported")
    first = 8 * (signal.start // 8) + 7 - signal.start % 8  # counted from the payload's first bit
    return Field(
        name=signal.name,
        shift=8 * message.length - first - signal.length,
        mask=(1 << signal.length) - 1,
        sign_bit=1 << (signal.length - 1) if signal.is_signed else 0,
        factor=signal.scale,
        offset=signal.offset,
    )
