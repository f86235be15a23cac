"""Reads physical values from CAN frames with valid counter and checksum."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from selfdrive.can.dbc import MessageLayout, SignalLayout
from selfdrive.can.packer import checksum_base, half_byte_sum
from selfdrive.messages import CanFrame

MOST_MISSED_PERIODS = 10  # periods without a frame until a message is invalid
MAX_BAD_COUNTERS = 5  # frames with a wrong counter before the message is rejected


class ExpectedMessage(NamedTuple):
    """A message to listen for: signals to read, rate in Hz, values before the first frame."""

    signals: tuple[str, ...]
    rate_hz: float
    initial_values: tuple[float, ...] | None = None  # zeros when None


class _MessageState:
    __slots__ = (
        "bad_counters",
        "body",
        "body_mask",
        "checksum_base",
        "checksum_mask",
        "counter",
        "counter_mask",
        "counter_shift",
        "fields",
        "name",
        "newest",
        "read",
        "size",
        "timeout",
    )

    def __init__(self, message: MessageLayout, expected: ExpectedMessage) -> None:
        self.name, self.size = message.name, message.size
        self.fields: list[SignalLayout] = [message.fields[name] for name in expected.signals]
        self.counter_shift = message.counter_shift or 0
        self.counter_mask = 0 if message.counter_shift is None else 0x3
        self.checksum_mask = 0xF if message.has_checksum else 0
        self.checksum_base = checksum_base(message.address)
        self.body_mask = sum(field.mask << field.shift for field in self.fields)
        self.body = -1  # the bits of `fields` in the last valid payload
        self.read: dict[bytes, int] = {}  # valid payloads with these bits, and their counters
        self.timeout = MOST_MISSED_PERIODS / expected.rate_hz + 1e-6  # 1e-6 s for the rounding of t
        self.newest = float("-inf")  # s, time of the last valid frame
        self.counter: int | None = None  # expected in the next frame
        self.bad_counters = 0

    def accept_payload(self, data: bytes, word: int) -> bool:
        if len(data) != self.size or (half_byte_sum(data) - self.checksum_base) & self.checksum_mask:
            return False
        counter = word >> self.counter_shift & self.counter_mask
        expected, self.counter = self.counter, counter + 1 & self.counter_mask
        if counter == expected or expected is None:
            if self.bad_counters:
                self.bad_counters -= 1
        else:
            self.bad_counters += 1
        return self.bad_counters < MAX_BAD_COUNTERS

    def store_signal_bits(self, data: bytes, word: int) -> bool:
        body = word & self.body_mask
        new = body != self.body
        if new:
            self.body = body
            self.read = {}
        if len(self.read) <= self.counter_mask:
            self.read[data] = word >> self.counter_shift & self.counter_mask
        return new


class CanParser:
    """Reads the `expected` messages of one bus.

    `values[name]` has a message's newest valid physical values in signal order. `valid` is False while any
    message is missing or overdue. `updated` names the messages of the last update.
    """

    def __init__(
        self, messages: Mapping[str, MessageLayout], expected: Mapping[str, ExpectedMessage], bus: int
    ) -> None:
        self.values: dict[str, tuple[float, ...]] = {
            name: e.initial_values or (0,) * len(e.signals) for name, e in expected.items()
        }
        self.updated: list[str] = []
        self.valid = False
        self._bus = bus
        self._states = {
            messages[name].address: _MessageState(messages[name], e) for name, e in expected.items()
        }
        self._valid_until = float("-inf")  # lower bound, recomputed when it has passed

    def update(self, frames: Sequence[CanFrame], t: float) -> None:
        states, bus = self._states, self._bus
        updated = []
        for address, data, frame_bus in frames:
            if frame_bus != bus or (state := states.get(address)) is None:
                continue
            counter = state.read.get(data)
            if counter is not None and counter == state.counter and not state.bad_counters:
                state.counter = counter + 1 & state.counter_mask
            else:
                word = int.from_bytes(data, "big")
                if not state.accept_payload(data, word):
                    continue
                if state.store_signal_bits(data, word):
                    self.values[state.name] = decode_payload(state.fields, word)
            state.newest = t
            updated.append(state.name)
        self.updated = updated
        if t > self._valid_until:
            self._valid_until = min([state.newest + state.timeout for state in states.values()])
        self.valid = t <= self._valid_until


def decode_payload(fields: Sequence[SignalLayout], word: int) -> tuple[float, ...]:
    return tuple(
        [
            ((word >> shift & mask ^ sign_bit) - sign_bit) * factor + offset
            for _, shift, mask, sign_bit, factor, offset in fields
        ]
    )
