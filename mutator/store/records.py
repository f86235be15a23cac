"""Records on disk: appended by workers, one file each, read back whatever a kill left behind."""

import json
import os
import time
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from mutator._common.files import check_schema, raising_disk_full
from mutator._common.hashing import canonical
from mutator.errors import CheckFailed, MutatorError
from mutator.model import Activation, Outcome, Record, RunError, Status

SCHEMA = "records/1"
TIMINGS_SCHEMA = "timings/1"
_BATCH = 32  # lines between two syncs
_BATCH_S = 2.0  # and at most this long


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


class LineWriter:
    """Appends JSON lines to a new file of its own: whole lines, synced in batches.

    A line that does not fit on the disk is taken back, so the file stays readable; DiskFull is raised.
    """

    def __init__(self, path: Path, head: Mapping[str, Any]) -> None:
        self.path = path
        self._unsynced = 0
        self._synced_at = time.monotonic()
        with raising_disk_full(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            self._fd = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND, 0o644)
        self._end = 0
        self.append(head)

    def append(self, value: Any) -> None:
        """Append one line; it is on the disk after the next `sync` at the latest."""
        data = canonical(value).encode() + b"\n"
        with raising_disk_full(self.path):
            try:
                written = 0
                while written < len(data):
                    written += os.write(self._fd, data[written:])
            except OSError:
                os.ftruncate(self._fd, self._end)
                raise
        self._end += len(data)
        self._unsynced += 1
        if self._unsynced >= _BATCH or time.monotonic() - self._synced_at > _BATCH_S:
            self.sync()

    def sync(self) -> None:
        """Make sure that what was appended survives a power cut."""
        with raising_disk_full(self.path):
            os.fsync(self._fd)
        self._unsynced = 0
        self._synced_at = time.monotonic()

    def close(self) -> None:
        try:
            self.sync()
        finally:
            os.close(self._fd)


def read_lines(path: Path, schema: str) -> Iterator[dict[str, Any]]:
    """The JSON lines of a file after its head; a torn last line is what a kill leaves, and is skipped."""
    lines = path.read_bytes().split(b"\n")
    complete, torn = lines[:-1], lines[-1]
    for number, line in enumerate(complete, start=1):
        try:
            value = json.loads(line)
        except ValueError:
            if number == len(complete) and not torn:
                return
            raise _damaged(path, number, line.decode("utf-8", "replace")) from None
        if number == 1:
            check_schema(value.get("schema") if isinstance(value, dict) else None, schema, path)
        else:
            yield value


def _damaged(path: Path, line: int, text: str) -> MutatorError:
    return MutatorError(
        f"damaged line: {text[:40]!r}",
        where=path,
        line=line,
        remedy="delete the line; what it told will be run again",
    )


def record_from(data: Mapping[str, Any]) -> Record:
    """The record of a parsed line."""
    activation = data["activation"]
    return Record(
        experiment_id=data["experiment_id"],
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
    )


def _pairs(items: list[list[Any]]) -> tuple[tuple[str, float], ...]:
    return tuple((name, value) for name, value in items)


def read_records(run: Path, folder: str = "records") -> dict[str, Record]:
    """The final record of each experiment id that has one (torn last lines are skipped).

    Any other record goes before a harness error. CheckFailed when two final records of one experiment differ.
    """
    records: dict[str, Record] = {}
    for path in sorted((run / folder).glob("*.jsonl")):
        for number, data in enumerate(read_lines(path, SCHEMA), start=2):
            try:
                record = record_from(data)
            except (KeyError, TypeError, ValueError):
                raise _damaged(path, number, canonical(data)) from None
            known = records.setdefault(record.experiment_id, record)
            if known == record or record.status is Status.HARNESS_ERROR:
                continue
            if known.status is not Status.HARNESS_ERROR:
                raise CheckFailed(
                    f"experiment {record.experiment_id} has two records that differ",
                    where=path,
                    expected="the same result each time",
                    remedy="this is a fault of the harness or of the machine; do not trust this run",
                )
            records[record.experiment_id] = record
    return records


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
