"""An index of lines by experiment. Each line is read when it is requested."""

from pathlib import Path
from typing import Any

import pytest

from mutator.errors import MutatorError
from mutator.store.checksummed_lines import LineWriter, line_file_bytes
from mutator.store.indexed_lines import IndexedLines

SCHEMA = "things/1"


def things(folder: Path, **files: list[dict[str, Any]]) -> IndexedLines[dict[str, Any]]:
    for name, lines in files.items():
        path = folder / f"{name}.jsonl"
        path.write_bytes(line_file_bytes(path, {"schema": SCHEMA}, lines))
    return opened(folder)


def opened(folder: Path) -> IndexedLines[dict[str, Any]]:
    paths = sorted(folder.glob("*.jsonl"))
    return IndexedLines(paths, SCHEMA, dict, lambda line, known: True)


def test_the_newest_line_replaces_the_first(tmp_path: Path) -> None:
    told = {"note": '"experiment_id":"zz"', "within": ['{"experiment_id":"yy"}']}
    many = {f"f{i:02}": [{"experiment_id": f"e{i}", "n": i}] for i in range(30)}
    found = things(tmp_path, a=[{"experiment_id": "aa", "n": 0, **told}], b=[{"experiment_id": "bb"}], **many)
    assert list(found)[:3] == ["aa", "bb", "e0"] and len(found) == 32 and "zz" not in found
    assert found["aa"] == {"experiment_id": "aa", "n": 0, **told}
    assert [found[f"e{i}"]["n"] for _ in range(2) for i in range(30)] == [*range(30)] * 2
    again = things(tmp_path, g=[{"experiment_id": "aa", "n": 1}])
    assert next(iter(again)) == "aa" and again["aa"]["n"] == 1


def test_a_damaged_line_is_reported_before_any_is_read(tmp_path: Path) -> None:
    things(tmp_path, a=[{"experiment_id": "aa", "n": 10}, {"experiment_id": "bb", "n": 20}])
    path = tmp_path / "a.jsonl"
    data = path.read_bytes()
    path.write_bytes(data[:-4])
    assert list(opened(tmp_path)) == ["aa"]
    path.write_bytes(data.replace(b"10", b"11"))
    with pytest.raises(MutatorError, match=r"a\.jsonl:2: a damaged line"):
        opened(tmp_path)


def test_an_invalid_line_is_reported_with_file_and_line(tmp_path: Path) -> None:
    path = tmp_path / "a.jsonl"
    lines = LineWriter(path, {"schema": SCHEMA})
    lines.append({"experiment_id": "aa"})
    lines.close()
    found = IndexedLines([path], SCHEMA, lambda line: int(line["n"]), lambda line, known: True)
    with pytest.raises(MutatorError, match=r"a\.jsonl:2: a damaged line"):
        found["aa"]
    with pytest.raises(MutatorError, match=r"b\.jsonl:2: a damaged line"):
        things(tmp_path, b=[{"n": 1}])
