"""Packs physical values into CAN frames, with counter and checksum."""

from collections.abc import Sequence

from selfdrive.can.dbc import MessageLayout, SignalLayout
from selfdrive.messages import CanFrame

new_frame = tuple.__new__  # CanFrame's own constructor takes three times as long
# by byte; looking sums up is faster than shifting each byte
_HALF_BYTE_SUMS = bytes((value >> 4) + (value & 0xF) for value in range(256))


def half_byte_sum(data: bytes) -> int:
    return sum(data.translate(_HALF_BYTE_SUMS))


def checksum_base(address: int) -> int:
    """The address's part of the checksum: the nibbles of address and data add up to 8 modulo 16."""
    return 8 - half_byte_sum(address.to_bytes(4, "big"))


def encode_payload(fields: Sequence[SignalLayout], values: Sequence[float]) -> int:
    """Return the payload as one big-endian integer. Values are clipped to their fields; NaN becomes 0."""
    word = 0
    for (_, shift, mask, sign_bit, factor, offset), value in zip(fields, values, strict=True):
        scaled = (value - offset) / factor
        try:
            raw = round(scaled) + sign_bit
        except (ValueError, OverflowError):
            raw = sign_bit if scaled != scaled else mask if scaled > 0 else 0
        if raw > mask:
            raw = mask
        elif raw < 0:
            raw = 0
        word |= (raw - sign_bit & mask) << shift
    return word


class MessagePacker:
    """Packs one message; `signals` fixes the order of the values given to `pack`."""

    def __init__(self, message: MessageLayout, signals: Sequence[str], bus: int = 0) -> None:
        self._fields = [message.fields[name] for name in signals]
        self._address, self._size, self._bus = message.address, message.size, bus
        self._counter_shift = message.counter_shift or 0
        self._counter_mask = 0 if message.counter_shift is None else 0x3
        self._checksum_mask = 0xF if message.has_checksum else 0
        self._checksum_base = checksum_base(message.address)
        self._values: tuple[float, ...] | None = None
        self._word = -1
        self._frames: dict[int, CanFrame] = {}  # by counter, for the current word; values often stay the same

    def pack(self, values: tuple[float, ...], counter: int = 0) -> CanFrame:
        """Return the frame for physical `values`; `counter` is the number of earlier frames."""
        if values != self._values:
            word = encode_payload(self._fields, values)
            self._values = values
            if word != self._word:
                self._word = word
                self._frames = {}
        counter &= self._counter_mask
        frame = self._frames.get(counter)
        if frame is None:
            frame = self._frames[counter] = self._frame(counter)
        return frame

    def _frame(self, counter: int) -> CanFrame:
        size = self._size
        word = self._word | counter << self._counter_shift
        halves = half_byte_sum(word.to_bytes(size, "big"))
        word |= (self._checksum_base - halves) & self._checksum_mask
        return new_frame(CanFrame, (self._address, word.to_bytes(size, "big"), self._bus))
