"""Timings are not sealed, so their values are checked when they are read."""

import json
from datetime import UTC, datetime
from pathlib import Path

import pytest

from mutator.errors import MutatorError
from mutator.store.checksummed_lines import LineWriter
from mutator.store.timings import TIMINGS_SCHEMA, ending_of, ending_text, load_timings

LINE = {
    "experiment_id": "a" * 16,
    "cpu_s": 0.5,
    "wall_s": 1,
    "host": "h",
    "worker": "1-1",
    "engine": None,
    "why": "",
}


def write(run: Path, line: dict[str, object]) -> None:
    (run / "timings").mkdir()
    writer = LineWriter(run / "timings" / "1-1.jsonl", {"schema": TIMINGS_SCHEMA, "plan": "p"})
    writer.append(line)
    writer.close()


def test_a_timing_is_read(tmp_path: Path) -> None:
    write(tmp_path, LINE)
    assert dict(load_timings(tmp_path)) == {"a" * 16: LINE}


def test_the_end_of_an_experiment_is_read_in_utc() -> None:
    moment = datetime(2026, 11, 24, 16, 31, 7, tzinfo=UTC)
    assert ending_of(LINE | {"ended": ending_text(moment)}) == moment
    assert ending_of(LINE) is None  # a line of an older version


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *[(name, value) for name in ("cpu_s", "wall_s") for value in ("x", None, True, [1], -1e308, 1e308)],
        *[(name, value) for name in ("host", "worker", "engine", "why") for value in (["a"], {"a": 1}, 1)],
        ("experiment_id", True),
        *[(name, "\x1b[2J") for name in ("host", "worker", "engine")],
        *[("ended", value) for value in (5, "yesterday", "2026-02-30T01:02:03Z", "")],
    ],
)
def test_another_type_of_a_value_is_a_damaged_line(tmp_path: Path, name: str, value: object) -> None:
    write(tmp_path, LINE | {name: value})
    with pytest.raises(MutatorError, match="line") as error:
        dict(load_timings(tmp_path))
    assert (error.value.where, error.value.line) == (f"{tmp_path}/timings/1-1.jsonl", 2)


@pytest.mark.parametrize("name", LINE)
def test_a_line_without_a_value_is_damaged(tmp_path: Path, name: str) -> None:
    write(tmp_path, {key: value for key, value in LINE.items() if key != name})
    with pytest.raises(MutatorError):
        dict(load_timings(tmp_path))


@pytest.mark.parametrize("number", ["1e999", "-1e999", "NaN", "9" * 5000])
def test_a_time_is_finite(tmp_path: Path, number: str) -> None:
    write(tmp_path, LINE)
    path = tmp_path / "timings" / "1-1.jsonl"
    head, line = path.read_text().splitlines()
    path.write_text(f"{head}\n{json.dumps(json.loads(line)).replace('0.5', number)}\n")
    with pytest.raises(MutatorError):
        dict(load_timings(tmp_path))
