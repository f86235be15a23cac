"""The target does not know about the harness or the environment."""

import re
from pathlib import Path

import pytest
import selfdrive

ROOT = Path(selfdrive.__path__[0])
FILES = sorted(ROOT.rglob("*.py"))


def name(file: Path) -> str:
    return file.relative_to(ROOT).as_posix()


@pytest.mark.parametrize("word", [r"\bmutator\b", r"\b_fi\b", r"\bfi:", r"\bmutants?\b"])
def test_the_target_knows_nothing_of_the_harness(word: str) -> None:
    assert len(FILES) > 80
    assert [name(file) for file in FILES if re.search(word, file.read_text(encoding="utf-8"))] == []


def test_the_target_reads_no_environment() -> None:
    reads = re.compile(r"\benviron\b|\bgetenv\b|\bexpanduser\b|\bPath\.home\b")
    readers = {name(file) for file in FILES if reads.search(file.read_text(encoding="utf-8"))}
    assert readers == {"sim/compile_helpers.py"}
