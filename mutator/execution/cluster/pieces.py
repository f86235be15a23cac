"""Pieces of work, and what comes back of one."""

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

from mutator.execution.cluster.parcel import pack, unpack
from mutator.model import Experiment
from mutator.store import plan_file


class Kind(StrEnum):
    """What is done with the experiments of a piece."""

    RUN = "run"
    PROVE = "prove"  # drive them on the reference engine, for the proof


class Ending(StrEnum):
    """How a piece of work ended."""

    DONE = "done"
    UNLIKE = "unlike"  # the worker drives another golden run than the campaign's
    UNFIT = "unfit"  # it has no more room, memory, files or processes, or lacks what the target needs
    DIED = "died"  # the process that runs pieces ended in the middle of it
    FAILED = "failed"  # by a defect of the harness


@dataclass(frozen=True, slots=True, kw_only=True)
class Piece:
    """Experiments that one worker is to run, most of them with the golden run `golden`.

    `lines` are those of the plan, by experiment id, in the plan's order; `faults` the lines of their faults.
    A run that several experiments share is whole in one piece.
    """

    number: int
    kind: Kind
    golden: str
    lines: Mapping[str, bytes]
    faults: tuple[bytes, ...]
    runs: int = 1  # that its experiments are: several may share one
    died_at: tuple[str, ...] = ()  # workers that it took down

    @property
    def ids(self) -> tuple[str, ...]:
        return tuple(self.lines)

    def packed(self) -> bytes:
        """What travels to the worker."""
        head = {"number": self.number, "kind": self.kind, "golden": self.golden, "ids": self.ids}
        parts = {"head": json.dumps(head).encode(), "plan": b"\n".join(self.lines.values())}
        return pack(parts | {"faults": b"\n".join(self.faults)})

    @classmethod
    def of(cls, data: bytes) -> "Piece":
        """A piece that has arrived; MutatorError where it is damaged."""
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
        """Its experiments; MutatorError for a line that is not what its id stands for."""
        faults = {fault.id: fault for fault in (plan_file.fault_from(json.loads(f)) for f in self.faults)}
        return tuple(plan_file.experiment_from(json.loads(line), faults) for line in self.lines.values())


@dataclass(frozen=True, slots=True, kw_only=True)
class Result:
    """What came of a piece. `text` says why it is not done, and `at` which experiment was being run then.

    `records` and `timings` are lines as files of the run folder have them, but for their checksums; `patches`
    and `series` blocks, in the form of their files.
    """

    number: int
    ending: Ending
    text: str = ""
    at: str = ""
    seconds: float = 0.0
    forked: bool = False  # whether a record is of an engine that a proof is needed for
    records: tuple[bytes, ...] = ()
    timings: tuple[bytes, ...] = ()
    patches: bytes = b""
    series: bytes = b""
    series_of: tuple[str, ...] = field(default=())  # golden runs that `series` are made with

    _HEAD = ("number", "ending", "text", "at", "seconds", "forked", "series_of")

    def packed(self) -> bytes:
        """What travels to the command."""
        head = {name: getattr(self, name) for name in self._HEAD}
        parts = {"head": json.dumps(head).encode(), "patches": self.patches, "series": self.series}
        return pack(parts | {"records": _joined(self.records), "timings": _joined(self.timings)})

    @classmethod
    def of(cls, data: bytes) -> "Result":
        """A result that has arrived; MutatorError where it is damaged."""
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
