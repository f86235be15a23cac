"""The page that maps fault models to failure modes."""

import re
from pathlib import Path

from mutator.workspace import Workspace

CLONE = Path(__file__).parents[4]
PAGE = CLONE / "docs/explanation/failure-modes.md"
_MODEL = re.compile(r"\[(\w+)\]\(\.\./reference/fault-models\.md#(\w+)\)")


def rows(heading: str) -> list[list[str]]:
    section = PAGE.read_text().partition(f"\n## {heading}\n")[2].partition("\n## ")[0]
    lines = [line for line in section.splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines[2:]]


def test_each_model_has_one_row(clone: Workspace) -> None:
    found = [name for first, *_ in rows("The models") for name in _MODEL.findall(first)]
    assert all(name == section for name, section in found)
    assert sorted(name for name, _ in found) == sorted(clone.fault_models().models)
    assert all(len(row) == 3 and all(row) for row in rows("The models"))


def test_each_unreachable_failure_mode_has_a_reason(clone: Workspace) -> None:
    missing = rows("What cannot be expressed, and why")
    assert len(missing) > 5 and all(len(row) == 2 and all(row) for row in missing)
    named = {name for row in missing for cell in row for name in re.findall(r"`([a-z_]+)`", cell)}
    assert named - {"value"} <= set(clone.fault_models().models)


def test_sources_are_listed_and_cited() -> None:
    text, _, sources = PAGE.read_text().partition("\n## Sources\n")
    listed = [line[2:].partition(",")[0] for line in sources.splitlines() if line.startswith("* ")]
    assert listed == sorted(listed) and len(listed) > 10
    assert all(name.partition(":")[0] in text for name in listed)
    cited = set(re.findall(r"([A-Z][\wà-ÿ]+) (?:and (?:[A-Z]\w+|others) )?\(?(?:19|20)\d\d\)", text))
    assert cited <= set(listed), cited - set(listed)
