"""Pieces of work, and their results."""

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any, ClassVar

from mutator.execution.cluster.packed_bytes import pack_parcel, unpack_parcel
from mutator.model import Experiment
from mutator.store.plan_lines import parse_experiment, parse_fault


class PieceKind(StrEnum):
    """What to do with the experiments of a piece."""

    RUN = "run"
    PROVE = "prove"  # run them on the reference engine for the proof


class PieceEnding(StrEnum):
    """How a piece of work ended."""

    FINISHED = "done"
    GOLDEN_DIFFERS = "unlike"  # the worker's golden run differs from the campaign's
    # the worker lacks disk space, memory, another resource, or a requirement of the target
    WORKER_UNFIT = "unfit"
    PROCESS_DIED = "died"  # the process that ran the piece ended
    HARNESS_FAILED = "failed"  # a defect of the harness


@dataclass(frozen=True, slots=True, kw_only=True)
class Piece:
    """Experiments for one worker, usually compared with one golden run.

    `plan_lines` are by experiment id, in plan order. `fault_lines` are the plan lines of their faults.
    Experiments that share a run stay in one piece.
    """

    number: int
    kind: PieceKind
    golden_key: str
    plan_lines: Mapping[str, bytes]
    fault_lines: tuple[bytes, ...]
    run_count: int = 1  # several experiments can share a run
    killed_workers: tuple[str, ...] = ()  # workers that this piece killed

    @property
    def experiment_ids(self) -> tuple[str, ...]:
        return tuple(self.plan_lines)

    def to_bytes(self) -> bytes:
        head = {
            "number": self.number,
            "kind": self.kind,
            "golden": self.golden_key,
            "ids": self.experiment_ids,
        }
        parts = {"head": json.dumps(head).encode(), "plan": b"\n".join(self.plan_lines.values())}
        return pack_parcel(parts | {"faults": b"\n".join(self.fault_lines)})

    @classmethod
    def from_bytes(cls, data: bytes) -> "Piece":
        """Unpack a piece; MutatorError if it is damaged."""
        parts = unpack_parcel(data)
        head = json.loads(parts["head"])
        return cls(
            number=head["number"],
            kind=PieceKind(head["kind"]),
            golden_key=head["golden"],
            plan_lines=dict(zip(head["ids"], parts["plan"].split(b"\n"), strict=True)),
            fault_lines=tuple(parts["faults"].split(b"\n")),
        )

    def parse_experiments(self) -> tuple[Experiment, ...]:
        """Parse the piece's experiments; MutatorError if a line does not match its id."""
        faults = {fault.id: fault for fault in map(parse_fault, self.fault_lines)}
        return tuple(parse_experiment(line, faults) for line in self.plan_lines.values())


@dataclass(frozen=True, slots=True, kw_only=True)
class PieceResult:
    """The result of a piece.

    If the piece is not done, `reason` says why, and `running_experiment` is the one that was running.
    `records` and `timings` are lines for the run folder, without checksums. `patches` and `series` are blocks
    for its block files.
    """

    number: int
    ending: PieceEnding
    reason: str = ""
    running_experiment: str = ""
    seconds: float = 0.0
    needs_proof: bool = False  # whether a record needs a proof
    records: tuple[bytes, ...] = ()
    timings: tuple[bytes, ...] = ()
    patches: bytes = b""
    series: bytes = b""
    series_goldens: tuple[str, ...] = field(default=())  # golden runs to which `series` refers

    _FIELD_BY_HEAD_KEY: ClassVar[dict[str, str]] = {
        "number": "number",
        "ending": "ending",
        "text": "reason",
        "at": "running_experiment",
        "seconds": "seconds",
        "forked": "needs_proof",
        "series_of": "series_goldens",
    }

    def to_bytes(self) -> bytes:
        head = {key: getattr(self, name) for key, name in self._FIELD_BY_HEAD_KEY.items()}
        parts = {"head": json.dumps(head).encode(), "patches": self.patches, "series": self.series}
        return pack_parcel(
            parts | {"records": _join_lines(self.records), "timings": _join_lines(self.timings)}
        )

    @classmethod
    def from_bytes(cls, data: bytes) -> "PieceResult":
        """Unpack a result; MutatorError if it is damaged."""
        parts = unpack_parcel(data)
        head: dict[str, Any] = json.loads(parts["head"])
        head |= {"ending": PieceEnding(head["ending"]), "series_of": tuple(head["series_of"])}
        return cls(
            **{cls._FIELD_BY_HEAD_KEY[key]: value for key, value in head.items()},
            patches=parts["patches"],
            series=parts["series"],
            records=tuple(parts["records"].splitlines()),
            timings=tuple(parts["timings"].splitlines()),
        )


def _join_lines(lines: Iterable[bytes]) -> bytes:
    return b"\n".join(lines)
