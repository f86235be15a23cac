"""CAN frames to physical values: nothing is believed before counter and checksum are right."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from selfdrive.can.dbc import Field, Message
from selfdrive.can.packer import checksum_base, half_byte_sum
from selfdrive.messages import CanFrame

MISSED_PERIODS = 10  # a message this much overdue is invalid
MAX_BAD_COUNTERS = 5  # frames with a wrong counter, before they are no longer believed


class Expected(NamedTuple):
    """A message to listen for: signals to read, rate in Hz, values before the first frame."""

    signals: tuple[str, ...]
    rate: float
    initial: tuple[float, ...] | None = None  # zeros when None


class _State:
    """One message's layout, its newest values, and when and how well it was received."""

    __slots__ = (
        "bad_counters",
        "checksum_base",
        "counter",
        "counter_shift",
        "fields",
        "has_checksum",
        "name",
        "seen",
        "size",
        "timeout",
    )

    def __init__(self, message: Message, expected: Expected) -> None:
        self.name, self.size = message.name, message.size
        self.fields: list[Field] = [message.fields[name] for name in expected.signals]
        self.has_checksum, self.counter_shift = message.has_checksum, message.counter_shift
        self.checksum_base = checksum_base(message.address)
        self.timeout = MISSED_PERIODS / expected.rate + 1e-6  # the excess keeps rounding of t out
        self.seen = float("-inf")
        self.counter: int | None = None
        self.bad_counters = 0

    def accepts(self, data: bytes, word: int) -> bool:
        """Whether size, checksum and counter are right; keeps count of wrong counters."""
        if len(data) != self.size:
            return False
        if self.has_checksum and (half_byte_sum(data) - self.checksum_base) & 0xF:
            return False
        if self.counter_shift is None:
            return True
        counter = word >> self.counter_shift & 0x3
        if self.counter is not None and counter != (self.counter + 1) & 0x3:
            self.bad_counters += 1
        elif self.bad_counters:
            self.bad_counters -= 1
        self.counter = counter
        return self.bad_counters < MAX_BAD_COUNTERS


class CanParser:
    """Reads the `expected` messages of one bus.

    `values[name]` are a message's newest valid physical values in the order of its signals.
    `valid` is False while any message is overdue, or has not come yet. `updated` names the messages
    of the last update.
    """

    def __init__(self, messages: Mapping[str, Message], expected: Mapping[str, Expected], bus: int) -> None:
        self.values: dict[str, tuple[float, ...]] = {
            name: e.initial or (0,) * len(e.signals) for name, e in expected.items()
        }
        self.updated: list[str] = []
        self.valid = False
        self._bus = bus
        self._states = {messages[name].address: _State(messages[name], e) for name, e in expected.items()}

    def update(self, frames: Sequence[CanFrame], t: float) -> None:
        """Take the frames received until time `t` (s)."""
        states, bus = self._states, self._bus
        updated = []
        for address, data, frame_bus in frames:
            if frame_bus != bus or (state := states.get(address)) is None:
                continue
            word = int.from_bytes(data, "big")
            if state.accepts(data, word):
                state.seen = t
                self.values[state.name] = decode(state.fields, word)
                updated.append(state.name)
        self.updated = updated
        self.valid = all(t - state.seen <= state.timeout for state in states.values())


def decode(fields: Sequence[Field], word: int) -> tuple[float, ...]:
    """Physical values of a payload read as one big-endian number."""
    return tuple(
        [
            ((word >> shift & mask ^ sign_bit) - sign_bit) * factor + offset
            for _, shift, mask, sign_bit, factor, offset in fields
        ]
    )
