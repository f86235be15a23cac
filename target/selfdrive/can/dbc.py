"""Reads a DBC file into bit layouts.

A payload is read as one big-endian integer, so a signal is a shift and a mask; only Motorola signals work.
Reading takes 1 ms; importing cantools, which tests use, takes 100 ms.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

COUNTER = "COUNTER"
CHECKSUM = "CHECKSUM"

_MESSAGE_PATTERN = re.compile(r"BO_ (?P<address>\d+) (?P<name>\w+) ?: (?P<size>\d+) \w+")
_SIGNAL_PATTERN = re.compile(
    r"SG_ (?P<name>\w+) : (?P<start>\d+)\|(?P<length>\d+)@0(?P<sign>[+-]) "
    r"\((?P<factor>[^,]+),(?P<offset>[^)]+)\) \[[^]]*\] \"[^\"]*\" .+"
)


class SignalLayout(NamedTuple):
    """One signal: `raw = word >> shift & mask`, `physical = raw * factor + offset`."""

    name: str
    shift: int
    mask: int
    sign_bit: int  # 0 for unsigned
    factor: float  # int if the file has an integer, so that counters stay integers
    offset: float


@dataclass(frozen=True, slots=True, kw_only=True)
class MessageLayout:
    """One frame's layout. A checksum is the low half of the last byte."""

    name: str
    address: int
    size: int  # bytes
    fields: Mapping[str, SignalLayout]
    has_checksum: bool
    counter_shift: int | None  # of the two-bit counter; None if there is none


@cache
def load_dbc(path: Path) -> Mapping[str, MessageLayout]:
    """Return all messages of a DBC file by name.

    Raises ValueError, with the line, for an unsupported message or signal.
    """
    layouts: list[tuple[re.Match[str], dict[str, SignalLayout]]] = []
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), start=1):
        where, text = f"{path}:{number}", line.strip()
        if text.startswith("BO_ "):
            layouts.append((_match(_MESSAGE_PATTERN, text, where, "BO_ ADDRESS NAME: SIZE SENDER"), {}))
        elif text.startswith("SG_ "):
            signal = _match(_SIGNAL_PATTERN, text, where, "a plain big-endian signal of a message")
            head, fields = layouts[-1]
            fields[signal["name"]] = _signal_layout(signal, int(head["size"]), where)
    return MappingProxyType({head["name"]: _message_layout(head, fields) for head, fields in layouts})


def _match(pattern: re.Pattern[str], text: str, where: str, expected: str) -> re.Match[str]:
    match = pattern.fullmatch(text)
    if match is None:
        raise ValueError(f"{where}: {text!r}, expected {expected}")
    return match


def _message_layout(head: re.Match[str], fields: dict[str, SignalLayout]) -> MessageLayout:
    name, counter, checksum = head["name"], fields.get(COUNTER), fields.get(CHECKSUM)
    if checksum is not None and (checksum.shift, checksum.mask) != (0, 0xF):
        raise ValueError(f"{name}: the checksum must be the low half of the last byte")
    if counter is not None and counter.mask != 0x3:
        raise ValueError(f"{name}: the counter must have two bits")
    return MessageLayout(
        name=name,
        address=int(head["address"]),
        size=int(head["size"]),
        fields=MappingProxyType(fields),
        has_checksum=checksum is not None,
        counter_shift=None if counter is None else counter.shift,
    )


def _signal_layout(signal: re.Match[str], size: int, where: str) -> SignalLayout:
    start, length = int(signal["start"]), int(signal["length"])
    first = 8 * (start // 8) + 7 - start % 8  # counted from the payload's first bit
    shift = 8 * size - first - length
    if shift < 0:
        raise ValueError(f"{where}: {signal['name']} ends beyond the message's {size} bytes")
    return SignalLayout(
        name=signal["name"],
        shift=shift,
        mask=(1 << length) - 1,
        sign_bit=1 << (length - 1) if signal["sign"] == "-" else 0,
        factor=_parse_number(signal["factor"]),
        offset=_parse_number(signal["offset"]),
    )


def _parse_number(text: str) -> float:
    try:
        return int(text)
    except ValueError:
        return float(text)
