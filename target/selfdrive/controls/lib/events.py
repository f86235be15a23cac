"""Events: what happened, and which transitions of the control state it asks for."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

ENABLE = "enable"  # engage
PRE_ENABLE = "pre_enable"  # engage, but wait while this lasts (gas pressed)
NO_ENTRY = "no_entry"  # refuses engaging
WARNING = "warning"  # shown while engaged
USER_DISABLE = "user_disable"  # the driver takes over
SOFT_DISABLE = "soft_disable"  # disengage after a warning time
IMMEDIATE_DISABLE = "immediate_disable"  # disengage now
PERMANENT = "permanent"  # shown whenever disabled


class Event(NamedTuple):
    """One event of one control cycle, with the kinds of reaction it asks for."""

    name: str
    kinds: tuple[str, ...]


def has_kind(events: Iterable[Event], kind: str) -> bool:
    """Whether any event asks for this kind of reaction."""
    return any(kind in event.kinds for event in events)


def names_of_kind(events: Sequence[Event], *kinds: str) -> list[str]:
    """Names of the events that ask for one of the kinds, in order of occurrence."""
    return [event.name for event in events if any(kind in event.kinds for kind in kinds)]
