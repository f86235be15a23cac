"""The target does not use the harness, and only its compile helpers read environment variables."""

import re
from pathlib import Path

import pytest
import selfdrive

ROOT = Path(selfdrive.__path__[0])
FILES = sorted(ROOT.rglob("*.py"))


def name(file: Path) -> str:
    return file.relative_to(ROOT).as_posix()


@pytest.mark.parametrize("word", [r"\bmutator\b", r"\b_fi\b", r"\bfi:", r"\bmutants?\b"])
def test_the_target_does_not_mention_the_harness(word: str) -> None:
    assert len(FILES) > 80
    assert [name(file) for file in FILES if re.search(word, file.read_text(encoding="utf-8"))] == []


def test_only_the_compile_helpers_read_environment_variables() -> None:
    reads = re.compile(r"\benviron\b|\bgetenv\b|\bexpanduser\b|\bPath\.home\b")
    readers = {name(file) for file in FILES if reads.search(file.read_text(encoding="utf-8"))}
    assert readers == {"sim/compile_helpers.py"}
