"""Reads the events of a job's command (`mutator._common.command_progress_events`)."""

from collections.abc import Iterator
from typing import Annotated, Literal

from pydantic import Field, TypeAdapter, ValidationError

from mutator.config.yaml_files import StrictModel

_MOST_LINE_BYTES = 16_384  # bytes; longer ones are dropped
Count = Annotated[int, Field(ge=0)]


class PhaseEvent(StrictModel):
    """What the command is doing; `total` 0: nothing to count."""

    event: Literal["phase"]
    phase: str
    done: Count
    total: Count
    outcomes: dict[str, Count]


class MessageEvent(StrictModel):
    """A sentence. The last `result` of a command counts."""

    event: Literal["warning", "result", "error"]
    text: str


class FileEvent(StrictModel):
    """A file that the command wrote."""

    event: Literal["link"]
    kind: str
    path: str


JobEvent = PhaseEvent | MessageEvent | FileEvent
_EVENT_ADAPTER: TypeAdapter[JobEvent] = TypeAdapter(Annotated[JobEvent, Field(discriminator="event")])


class EventReader:
    """Splits what comes out of the pipe into events. Lines that are not events are dropped."""

    def __init__(self) -> None:
        self._rest = b""

    def read(self, data: bytes) -> Iterator[JobEvent]:
        *lines, self._rest = (self._rest + data).split(b"\n")
        if len(self._rest) > _MOST_LINE_BYTES:
            self._rest = self._rest[:_MOST_LINE_BYTES] + b"\0"  # never a valid line
        for line in lines:
            try:
                yield _EVENT_ADAPTER.validate_json(line)
            except ValidationError:
                continue
