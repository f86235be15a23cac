"""Pieces of work, and their results."""

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

from mutator.execution.cluster.parcel import pack, unpack
from mutator.model import Experiment
from mutator.store.plan_lines import parse_experiment, parse_fault


class Kind(StrEnum):
    """What to do with the experiments of a piece."""

    RUN = "run"
    PROVE = "prove"  # run them on the reference engine for the proof


class Ending(StrEnum):
    """How a piece of work ended."""

    DONE = "done"
    UNLIKE = "unlike"  # the worker's golden run differs from the campaign's
    UNFIT = "unfit"  # the worker lacks disk space, memory, another resource, or a requirement of the target
    DIED = "died"  # the process that ran the piece ended
    FAILED = "failed"  # a defect of the harness


@dataclass(frozen=True, slots=True, kw_only=True)
class Piece:
    """Experiments for one worker, usually compared with the golden run `golden`.

    `lines` are plan lines by experiment id, in plan order. `faults` are the plan lines of their faults.
    Experiments that share a run stay in one piece.
    """

    number: int
    kind: Kind
    golden: str
    lines: Mapping[str, bytes]
    faults: tuple[bytes, ...]
    runs: int = 1  # several experiments can share a run
    died_at: tuple[str, ...] = ()  # workers that this piece killed

    @property
    def ids(self) -> tuple[str, ...]:
        return tuple(self.lines)

    def packed(self) -> bytes:
        head = {"number": self.number, "kind": self.kind, "golden": self.golden, "ids": self.ids}
        parts = {"head": json.dumps(head).encode(), "plan": b"\n".join(self.lines.values())}
        return pack(parts | {"faults": b"\n".join(self.faults)})

    @classmethod
    def of(cls, data: bytes) -> "Piece":
        """Unpack a piece; MutatorError if it is damaged."""
        parts = unpack(data)
        head = json.loads(parts["head"])
        return cls(
            number=head["number"],
            kind=Kind(head["kind"]),
            golden=head["golden"],
            lines=dict(zip(head["ids"], parts["plan"].split(b"\n"), strict=True)),
            faults=tuple(parts["faults"].split(b"\n")),
        )

    def experiments(self) -> tuple[Experiment, ...]:
        """Parse the piece's experiments; MutatorError if a line does not match its id."""
        faults = {fault.id: fault for fault in map(parse_fault, self.faults)}
        return tuple(parse_experiment(line, faults) for line in self.lines.values())


@dataclass(frozen=True, slots=True, kw_only=True)
class Result:
    """The result of a piece.

    If the piece is not done, `text` says why, and `at` is the experiment that was running.
    `records` and `timings` are lines for the run folder, without checksums. `patches` and `series` are blocks
    for its block files.
    """

    number: int
    ending: Ending
    text: str = ""
    at: str = ""
    seconds: float = 0.0
    forked: bool = False  # whether a record needs a proof
    records: tuple[bytes, ...] = ()
    timings: tuple[bytes, ...] = ()
    patches: bytes = b""
    series: bytes = b""
    series_of: tuple[str, ...] = field(default=())  # golden runs to which `series` refers

    _HEAD = ("number", "ending", "text", "at", "seconds", "forked", "series_of")

    def packed(self) -> bytes:
        head = {name: getattr(self, name) for name in self._HEAD}
        parts = {"head": json.dumps(head).encode(), "patches": self.patches, "series": self.series}
        return pack(parts | {"records": _joined(self.records), "timings": _joined(self.timings)})

    @classmethod
    def of(cls, data: bytes) -> "Result":
        """Unpack a result; MutatorError if it is damaged."""
        parts = unpack(data)
        head: dict[str, Any] = json.loads(parts["head"])
        return cls(
            **head | {"ending": Ending(head["ending"]), "series_of": tuple(head["series_of"])},
            patches=parts["patches"],
            series=parts["series"],
            records=tuple(parts["records"].splitlines()),
            timings=tuple(parts["timings"].splitlines()),
        )


def _joined(lines: Iterable[bytes]) -> bytes:
    return b"\n".join(lines)
