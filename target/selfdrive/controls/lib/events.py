"""Events, and the state transitions that they request."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

ENABLE = "enable"  # engage
PRE_ENABLE = "pre_enable"  # engage, but wait while this event lasts (gas pressed)
NO_ENTRY = "no_entry"  # refuse to engage
WARNING = "warning"  # shown while engaged
USER_DISABLE = "user_disable"  # the driver takes over
SOFT_DISABLE = "soft_disable"  # disengage after a warning time
IMMEDIATE_DISABLE = "immediate_disable"  # disengage now
PERMANENT = "permanent"  # shown as long as it lasts, engaged or not


class Event(NamedTuple):
    name: str
    kinds: tuple[str, ...]


def has_kind(events: Iterable[Event], kind: str) -> bool:
    return any(kind in event.kinds for event in events)


def names_of_kind(events: Sequence[Event], kind: str) -> list[str]:
    return [event.name for event in events if kind in event.kinds]
