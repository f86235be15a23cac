"""Records on disk."""

import json
from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path

import pytest

from mutator._common.hashing import canonical_json
from mutator.errors import CheckFailed, MutatorError
from mutator.model import (
    AgainstGolden,
    DefenceActivity,
    ObservedActivation,
    Outcome,
    Record,
    RunError,
    Status,
)
from mutator.store import run_progress
from mutator.store.checksummed_lines import LineWriter
from mutator.store.records import RECORDS_SCHEMA, load_records, record_as_json
from mutator.store.run_progress import RecordTail

HEAD = {"schema": RECORDS_SCHEMA, "plan": "p"}
MakeRecord = Callable[..., Record]


def write(run: Path, name: str, *records: Record) -> Path:
    writer = LineWriter(run / "records" / name, HEAD)
    for record in records:
        writer.append(asdict(record))
    writer.close()
    return writer.path


def test_records_are_read_as_written(tmp_path: Path, record: MakeRecord) -> None:
    first = record(
        "a" * 16, max_dev=(("gas", float("inf")),), hazards=(("H1", 3.25),), alerts=(("fcw", 3.0),)
    )
    error = RunError(kind="Boom", message="ü", place="car/go.py:3")
    second = record("b" * 16, status=Status.CRASHED, outcome=None, detail="Boom: ü", error=error)
    write(tmp_path, "0001-gw0.jsonl", first)
    write(tmp_path, "0001-gw1.jsonl", second)
    assert load_records(tmp_path) == {"a" * 16: first, "b" * 16: second}


def test_a_line_equals_asdict(record: MakeRecord) -> None:
    activation = ObservedActivation(first=1.0, last=2.0, count=3)
    error = RunError(kind="ValueError", message="no", place="a.py:3")
    for one in (record(), replace(record(), activation=activation), replace(record(), error=error)):
        expected = asdict(one)
        assert (expected.pop("against_golden"), expected.pop("golden_hazards")) == (None, ())
        assert [expected.pop(name) for name in ("t_back", "ended_disengaged", "defences", "run_end")] == [
            None,
            False,
            (),
            None,
        ]
        assert canonical_json(record_as_json(one)) == canonical_json(expected)


def test_a_line_has_how_hazards_compare_with_goldens_only_if_golden_has_some(
    tmp_path: Path, record: MakeRecord
) -> None:
    """So the lines of all other runs keep their bytes, and their digests."""
    compared = replace(record("a" * 16), against_golden=AgainstGolden.LATER, golden_hazards=(("H1", 12.5),))
    line = record_as_json(compared)
    assert (line["against_golden"], line["golden_hazards"]) == ("later", (("H1", 12.5),))
    write(tmp_path, "0001-gw0.jsonl", compared)
    assert load_records(tmp_path) == {"a" * 16: compared}


def test_a_record_without_an_error_has_no_such_key(tmp_path: Path, record: MakeRecord) -> None:
    """Older versions wrote no such key."""
    writer = LineWriter(tmp_path / "records" / "0001-gw0.jsonl", HEAD)
    writer.append(record())
    writer.close()
    line = json.loads(writer.path.read_text().splitlines()[1])
    assert "error" not in line
    assert load_records(tmp_path)[line["experiment_id"]].error is None


@pytest.mark.parametrize("keep", [1, 20, -1, -2])
def test_an_incomplete_last_line_is_skipped(tmp_path: Path, record: MakeRecord, keep: int) -> None:
    path = write(tmp_path, "0001-gw0.jsonl", record("a" * 16), record("b" * 16))
    lines = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(b"".join(lines[:-1]) + lines[-1][:keep])
    assert set(load_records(tmp_path)) == {"a" * 16}


@pytest.mark.parametrize("content", [b"", b'{"sche'])
def test_a_file_without_its_head_has_no_records(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "records").mkdir()
    (tmp_path / "records" / "0001-gw0.jsonl").write_bytes(content)
    assert load_records(tmp_path) == {}


def test_an_invalid_record_is_reported(tmp_path: Path) -> None:
    writer = LineWriter(tmp_path / "records" / "0001-gw0.jsonl", HEAD)
    writer.append({"experiment_id": 3})
    writer.close()
    with pytest.raises(MutatorError, match=r"0001-gw0\.jsonl:2: a damaged line"):
        load_records(tmp_path)["3"]


def test_a_newer_schema_is_refused(tmp_path: Path) -> None:
    LineWriter(tmp_path / "records" / "0001-gw0.jsonl", {"schema": "records/99"}).close()
    with pytest.raises(MutatorError, match="use a newer version of mutator"):
        load_records(tmp_path)


@pytest.mark.parametrize("error_first", [True, False])
def test_any_record_replaces_a_harness_error(tmp_path: Path, record: MakeRecord, error_first: bool) -> None:
    wrong = record(status=Status.HARNESS_ERROR, outcome=None, detail="killed from outside")
    good = record()
    write(tmp_path, "0001-gw0.jsonl", wrong if error_first else good)
    write(tmp_path, "0002-gw0.jsonl", good if error_first else wrong)
    assert load_records(tmp_path) == {good.experiment_id: good}


def test_two_different_records_of_one_experiment_fail(tmp_path: Path, record: MakeRecord) -> None:
    write(tmp_path, "0001-gw0.jsonl", record())
    write(tmp_path, "0003-gw0.jsonl", record(outcome=Outcome.SDC, t_manifest=2.5))
    with pytest.raises(CheckFailed, match="two records that differ"):
        load_records(tmp_path)


def test_a_second_record_is_refused(tmp_path: Path, record: MakeRecord) -> None:
    """A finished experiment does not run again."""
    write(tmp_path, "0001-gw0.jsonl", record())
    write(tmp_path, "0002-gw0.jsonl", record())
    with pytest.raises(MutatorError, match=r"0002-gw0\.jsonl:2: a second record of experiment e{16}"):
        load_records(tmp_path)


def test_progress_counts_complete_lines_as_they_arrive(
    tmp_path: Path, record: MakeRecord, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A line counts once it is complete; the rate counts from the first finished experiments."""
    now_s = 100.0
    monkeypatch.setattr(run_progress.time, "monotonic", lambda: now_s)
    write(tmp_path, "0001-gw0.jsonl", record("a" * 16))
    tail = RecordTail("experiments", tmp_path, "records", 4)
    assert (tail.poll().done, tail.poll().per_s, tail.poll().remaining_s) == (1, None, None)
    writer = LineWriter(tmp_path / "records" / "0002-gw0.jsonl", HEAD)
    writer.append(asdict(record("b" * 16, status=Status.HARNESS_ERROR, outcome=None)))
    assert tail.poll().outcomes == {"masked": 1, "harness_error": 1}
    writer.append(asdict(record("b" * 16, outcome=Outcome.HAZARD)))
    with writer.path.open("ab") as file:
        file.write(json.dumps(asdict(record("c" * 16))).encode()[:50])
    progress = tail.poll()
    assert (progress.done, progress.total) == (2, 4)
    assert progress.outcomes == {"masked": 1, "hazard": 1}
    assert (progress.per_s, progress.remaining_s) == (None, None)
    now_s = 102.0
    with writer.path.open("ab") as file:
        file.truncate(file.tell() - 50)
    writer.append(asdict(record("c" * 16)))
    progress = tail.poll()
    assert (progress.done, progress.per_s, progress.remaining_s) == (3, 0.5, 2.0)


def test_what_defences_did_is_read_as_written(tmp_path: Path, record: MakeRecord) -> None:
    brake = DefenceActivity(
        name="brake",
        first=1.0,
        last=2.5,
        activations=2,
        steps=30,
        conflicts=1,
        commands=(("gas", 0.2, 0.0), ("brake", 0.5, 1.0)),
    )
    first = record("a" * 16, defences=(brake, replace(brake, name="limit", commands=())))
    write(tmp_path, "0001-gw0.jsonl", first)
    assert load_records(tmp_path) == {"a" * 16: first}
