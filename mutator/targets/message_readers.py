"""Where a target reads messages, as its manifest declares it."""

from collections.abc import Mapping
from dataclasses import dataclass

from mutator.model import FaultLocation


@dataclass(frozen=True, slots=True, kw_only=True)
class MessageReader:
    """A place at which a part of the target gets its messages.

    `queue` is the variable with the messages of one reading, in order; `message` instead is the variable with
    a single one, as in a callback. `topic` is an expression of `message` (None: every message is of the one
    topic), and `value_by_topic` has its value for each topic. `where` selects one reader among several that
    share the code.
    """

    name: str
    location: FaultLocation
    queue: str | None
    message: str | None
    topic: str | None
    value_by_topic: Mapping[str, str | int]
    where: str | None
