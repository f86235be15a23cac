"""Records on disk: what a line has, and the readers of whole records and of their endings."""

import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any, NamedTuple

from mutator._common.confined_files import path_below
from mutator.errors import CheckFailed, MutatorError
from mutator.model import (
    AgainstGolden,
    DefenceActivity,
    ObservedActivation,
    Outcome,
    Record,
    RunEnd,
    RunError,
    Status,
)
from mutator.store.indexed_lines import IndexedLine, IndexedLines
from mutator.store.timings import TIMINGS_FOLDER, TIMINGS_SCHEMA

RECORDS_SCHEMA = "records/2"
RECORDS_FOLDER, PROOF_FOLDER = "records", "proof"  # folders of files of lines
LINE_SCHEMA_BY_FOLDER = {
    RECORDS_FOLDER: RECORDS_SCHEMA,
    TIMINGS_FOLDER: TIMINGS_SCHEMA,
    PROOF_FOLDER: RECORDS_SCHEMA,
}
_RECORD_FIELDS = tuple(field.name for field in fields(Record))
_DATACLASS_FIELDS = ("activation", "error", "run_end")  # fields that contain dataclasses
# left out while they have no value, as in most records
_OMITTED_FIELDS = ("against_golden", "golden_hazards", "t_back", "ended_disengaged", "defences", "run_end")


def record_as_json(record: Record) -> dict[str, Any]:
    """Convert a record like `asdict`, but without copying every tuple."""
    line = {name: getattr(record, name) for name in _RECORD_FIELDS}
    for name in _OMITTED_FIELDS:
        if not line[name]:
            del line[name]
    if record.defences:
        line["defences"] = [asdict(activity) for activity in record.defences]
    return line | {name: asdict(line[name]) for name in _DATACLASS_FIELDS if line.get(name) is not None}


def record_from_json(data: Mapping[str, Any]) -> Record:
    activation = data["activation"]
    return Record(
        experiment_id=str(data["experiment_id"]),
        status=Status(data["status"]),
        outcome=Outcome(data["outcome"]) if data["outcome"] else None,
        detail=data["detail"],
        tree=data["tree"],
        activation=ObservedActivation(**activation) if activation else None,
        t_manifest=data["t_manifest"],
        max_dev=_name_value_pairs(data["max_dev"]),
        hazards=_name_value_pairs(data["hazards"]),
        alerts=_name_value_pairs(data["alerts"]),
        trace_digest=data["trace_digest"],
        error=RunError(**data["error"]) if data.get("error") else None,
        patch=data.get("patch", ""),
        t_end=data.get("t_end"),
        dev=_name_value_pairs(data.get("dev", [])),
        metrics=_name_value_pairs(data.get("metrics", [])),
        left=tuple([(name, first, largest) for name, first, largest in data.get("left", ())]),
        first_change=tuple(data["first_change"]) if data.get("first_change") else None,
        first_change_share=data.get("first_change_share"),
        speeds=_name_value_pairs(data.get("speeds", [])),
        against_golden=AgainstGolden(data["against_golden"]) if data.get("against_golden") else None,
        golden_hazards=_name_value_pairs(data.get("golden_hazards", [])),
        t_back=data.get("t_back"),
        ended_disengaged=bool(data.get("ended_disengaged", False)),
        defences=tuple([_defence_activity(item) for item in data.get("defences", ())]),
        run_end=RunEnd(**data["run_end"]) if data.get("run_end") else None,
    )


def _defence_activity(data: dict[str, Any]) -> DefenceActivity:
    commands = tuple([(name, change, value) for name, change, value in data["commands"]])
    return DefenceActivity(**(data | {"commands": commands}))


def _name_value_pairs(items: list[list[Any]]) -> tuple[tuple[str, float], ...]:
    return tuple([(name, value) for name, value in items])  # a list is faster than a generator


class RecordEnding(NamedTuple):
    """How an experiment ended: the most frequently read part of a record."""

    experiment_id: str
    status: str
    outcome: str | None
    patch_digest: str

    @property
    def is_final(self) -> bool:
        """Whether the experiment is finished. A harness error is retried."""
        return self.status != Status.HARNESS_ERROR.value


# Lines are canonical JSON. Quotation marks inside a string are escaped, so no pattern matches there.
_ID_KEY, _OUTCOME_KEY = b'"experiment_id":"', b'"outcome":'
_ENDING_PATTERN = re.compile(rb'"outcome":(?:null|"([a-z_]+)"),"patch":"([0-9a-f]*)","status":"([a-z_]+)"')
_KEYS_WRITTEN_ONCE = (b'"experiment_id":', _OUTCOME_KEY, b'"patch":', b'"status":')


def parse_ending(line: bytes) -> RecordEnding:
    """Read the ending from a record's line, ten times as fast as the whole record.

    An invalid line raises the errors of `json.loads`, KeyError, TypeError or AttributeError.
    """
    begin = line.find(_ID_KEY) + len(_ID_KEY)
    match = _ENDING_PATTERN.match(line, line.find(_OUTCOME_KEY))
    if begin >= len(_ID_KEY) and match and all(line.count(key) == 1 for key in _KEYS_WRITTEN_ONCE):
        outcome = match[1].decode() if match[1] else None
        return RecordEnding(
            line[begin : line.index(b'"', begin)].decode(), match[3].decode(), outcome, match[2].decode()
        )
    data = json.loads(line)
    return RecordEnding(
        str(data["experiment_id"]), data["status"], data.get("outcome"), str(data.get("patch", ""))
    )


def endings_of(records: Mapping[str, Record]) -> Iterator[RecordEnding]:
    for name in records:
        if isinstance(records, IndexedLines):
            line = records.read_line(name)
            try:
                yield parse_ending(line.data)
            except (ValueError, LookupError, TypeError, AttributeError, RecursionError):
                raise records.damage_error(line) from None
        else:
            record = records[name]
            yield RecordEnding(
                name, record.status.value, record.outcome.value if record.outcome else None, record.patch
            )


def load_records(run: Path, folder: str = "records") -> IndexedLines[Record]:
    """Return the record of each experiment that has one; a torn last line is skipped.

    A harness error is replaced by any other record of its experiment. MutatorError for a damaged line, and
    for a second final record of an experiment; CheckFailed if the two differ.
    """
    paths = sorted(path_below(run, folder).glob("*.jsonl"))
    return IndexedLines(paths, RECORDS_SCHEMA, record_from_json, _replaces)


def _replaces(line: IndexedLine, earlier: IndexedLine) -> bool:
    record, before = (record_from_json(record_line.parse()) for record_line in (line, earlier))
    if record.status is Status.HARNESS_ERROR:
        return False
    if before.status is not Status.HARNESS_ERROR:
        raise second_record_error(line.path, line.number, record.experiment_id, same=before == record)
    return True


def second_record_error(path: Path, line: int, experiment_id: str, *, same: bool) -> MutatorError:
    """Make the error about a second final record of an experiment."""
    if same:
        return MutatorError(
            f"a second record of experiment {experiment_id}",
            where=path,
            line=line,
            expected="one record per experiment",
            remedy="delete the file if it is a copy of another one",
        )
    return CheckFailed(
        f"experiment {experiment_id} has two records that differ",
        where=path,
        line=line,
        expected="the same result each time",
        remedy="this is a defect of the harness or the machine; do not trust this run",
    )
