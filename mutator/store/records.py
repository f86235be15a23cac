"""Records on disk: appended by workers, one file each, read back whatever a kill left behind."""

import json
import time
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from mutator.errors import CheckFailed, MutatorError
from mutator.model import Activation, Outcome, Record, RunError, Status
from mutator.store.lines import read_segment

SCHEMA = "records/2"
TIMINGS_SCHEMA = "timings/2"


@dataclass(kw_only=True)
class Progress:
    """How far a run is. `outcomes` counts outcomes of ok experiments and the other statuses by name."""

    stage: str  # "plan", "checks", "experiments", "results"
    detail: str = ""
    done: int = 0
    total: int = 0
    outcomes: Counter[str] = field(default_factory=Counter)
    per_s: float | None = None  # experiments a second since this command began
    remaining_s: float | None = None


def record_from(data: Mapping[str, Any]) -> Record:
    """The record of a parsed line."""
    activation = data["activation"]
    return Record(
        experiment_id=str(data["experiment_id"]),
        status=Status(data["status"]),
        outcome=Outcome(data["outcome"]) if data["outcome"] else None,
        detail=data["detail"],
        tree=data["tree"],
        activation=Activation(**activation) if activation else None,
        t_manifest=data["t_manifest"],
        max_dev=_pairs(data["max_dev"]),
        hazards=_pairs(data["hazards"]),
        alerts=_pairs(data["alerts"]),
        trace_digest=data["trace_digest"],
        error=RunError(**data["error"]) if data.get("error") else None,
        patch=data.get("patch", ""),
        t_end=data.get("t_end"),
        dev=_pairs(data.get("dev", [])),
        metrics=_pairs(data.get("metrics", [])),
    )


def _pairs(items: list[list[Any]]) -> tuple[tuple[str, float], ...]:
    return tuple((name, value) for name, value in items)


def read_records(run: Path, folder: str = "records", *, checksums: bool = True) -> dict[str, Record]:
    """The final record of each experiment id that has one (torn last lines are skipped).

    Any other record goes before a harness error. MutatorError for a damaged line and for a second record of
    one experiment; CheckFailed when the two differ.
    """
    records: dict[str, Record] = {}
    for path in sorted((run / folder).glob("*.jsonl")):
        segment = read_segment(path, checksums=checksums)
        for number, data in segment.objects(SCHEMA):
            try:
                record = record_from(data)
            except (KeyError, TypeError, ValueError):
                raise segment.problem(number) from None
            known = records.setdefault(record.experiment_id, record)
            if known is record or record.status is Status.HARNESS_ERROR:
                continue
            if known.status is not Status.HARNESS_ERROR:
                raise second_record(path, number, record.experiment_id, same=known == record)
            records[record.experiment_id] = record
    return records


def second_record(path: Path, line: int, experiment_id: str, *, same: bool) -> MutatorError:
    """What is said of a second final record of an experiment."""
    if same:
        return MutatorError(
            f"a second record of experiment {experiment_id}",
            where=path,
            line=line,
            expected="one of each",
            remedy="delete the file if it is a copy of another one",
        )
    return CheckFailed(
        f"experiment {experiment_id} has two records that differ",
        where=path,
        line=line,
        expected="the same result each time",
        remedy="this is a fault of the harness or of the machine; do not trust this run",
    )


def label(status: str, outcome: str | None) -> str:
    """What Progress counts: the outcome of what ran, else the status."""
    return str(outcome or status)


class Tail:
    """Follows the records of a run as they are appended, reading each byte once."""

    def __init__(self, run: Path, total: int) -> None:
        self._folder = run / "records"
        self._total = total
        self._offsets: dict[Path, int] = {}
        self._labels: dict[str, str] = {}
        self._began = time.monotonic()
        self._read()
        self._before = len(self._labels)

    def poll(self) -> Progress:
        """Where the run is now; the remaining time comes from the rate since this Tail was made."""
        self._read()
        done, elapsed = len(self._labels), time.monotonic() - self._began
        per_s = (done - self._before) / elapsed if done > self._before else None
        return Progress(
            stage="experiments",
            done=done,
            total=self._total,
            outcomes=Counter(self._labels.values()),
            per_s=per_s,
            remaining_s=(self._total - done) / per_s if per_s else None,
        )

    def _read(self) -> None:
        for path in self._folder.glob("*.jsonl"):
            offset = self._offsets.get(path, 0)
            with path.open("rb") as file:
                file.seek(offset)
                data = file.read()
            end = data.rfind(b"\n") + 1
            self._offsets[path] = offset + end
            for line in data[:end].splitlines():
                self._count(line)

    def _count(self, line: bytes) -> None:
        try:
            data = json.loads(line)
            name = label(data["status"], data["outcome"])
            if name != Status.HARNESS_ERROR or data["experiment_id"] not in self._labels:
                self._labels[data["experiment_id"]] = name
        except (ValueError, KeyError):  # a head, or damage that read_records will tell
            return
