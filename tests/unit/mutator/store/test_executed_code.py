"""What runs executed, on disk: shared lines, and no trust in damaged ones."""

import dataclasses
from pathlib import Path
from typing import Any

from mutator.store.checksummed_lines import LineWriter
from mutator.store.executed_code import (
    EXECUTED_FOLDER,
    EXECUTED_SCHEMA,
    ExecutedCode,
    ExecutedCodeLines,
    ExecutedCodes,
)

CODE = ExecutedCode(
    parts_by_file={"car/a.py": {"<module>": "1a", "f": "2b"}, "car/b.py": {"<module>": "3c"}},
    files_read={"car/b.py": "4d"},
    packages={"numpy": "2.0", "gone": None},
    surroundings={"mutator": "5e"},
)
OTHER = dataclasses.replace(
    CODE, parts_by_file={**CODE.parts_by_file, "car/b.py": {"<module>": "3c", "g": "6f"}}
)


def written(run: Path, *codes: ExecutedCode) -> list[str]:
    writer = LineWriter(run / EXECUTED_FOLDER / "w1.jsonl", {"schema": EXECUTED_SCHEMA, "plan": "p"})
    lines = ExecutedCodeLines(writer.append)
    digests = [lines.append(code) for code in codes]
    writer.close()
    return digests


def test_what_was_written_is_read(tmp_path: Path) -> None:
    digests = written(tmp_path, CODE, OTHER)
    codes = ExecutedCodes(tmp_path)
    assert [codes.find(one) for one in digests] == [CODE, OTHER]
    assert codes.find("0" * 32) is None


def test_what_is_equal_is_written_once(tmp_path: Path) -> None:
    """Runs that executed the same share a line, and others share those of most files."""
    first, second, third = written(tmp_path, CODE, CODE, OTHER)
    assert first == second != third
    lines = (tmp_path / EXECUTED_FOLDER / "w1.jsonl").read_text().splitlines()
    assert len(lines) == 1 + 3 + 2  # the head; two files and the run; the file and the run that differ


def test_damage_is_ignored(tmp_path: Path) -> None:
    """Who executed something that is damaged is not known, so the experiment runs."""
    whole, other = written(tmp_path, CODE, OTHER)
    path = tmp_path / EXECUTED_FOLDER / "w1.jsonl"
    path.write_bytes(path.read_bytes().replace(b"6f", b"7f"))
    codes = ExecutedCodes(tmp_path)
    assert codes.find(whole) == CODE
    assert codes.find(other) is None


def test_a_line_under_another_digest_is_ignored(tmp_path: Path) -> None:
    """A line is found by the digest of its content, so nobody can put another one in its place."""
    writer = LineWriter(tmp_path / EXECUTED_FOLDER / "w1.jsonl", {"schema": EXECUTED_SCHEMA, "plan": "p"})
    forged: dict[str, Any] = {"files": [], "read": {}, "packages": {}, "surroundings": {}, "obstacle": ""}
    writer.append({"digest": "ab", **forged})
    writer.close()
    assert ExecutedCodes(tmp_path).find("ab") is None


def test_a_folder_without_lines_has_nothing(tmp_path: Path) -> None:
    assert ExecutedCodes(tmp_path).find("ab") is None
