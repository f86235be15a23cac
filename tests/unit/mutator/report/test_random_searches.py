"""Random searches that a report stored, which anybody can edit."""

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from mutator.report import random_searches
from mutator.report.random_searches import RandomSearch, RandomSearches, stored_random_searches
from mutator.store.run_folder import RunFolder


def stored(run: Path, text: str) -> RandomSearches:
    (run / "report").mkdir()
    (run / "report" / "random_searches.json").write_text(text)
    return stored_random_searches(RunFolder(run))


def test_stored_searches_are_read(tmp_path: Path) -> None:
    searches = RandomSearches(searches=(RandomSearch(name="chance", counts=(0, 0, 1)),))
    assert stored(tmp_path, searches.as_bytes().decode()) == searches


@pytest.mark.parametrize("counts", [[], [-1], [0, 2, 1], ["1"], None])
def test_counts_that_no_search_has_are_not_shown(tmp_path: Path, counts: object) -> None:
    """Findings grow from run to run, from 0 on."""
    content = {"schema": "random-searches/1", "searches": [{"name": "chance", "counts": counts}]}
    assert stored(tmp_path, json.dumps(content)) == RandomSearches()


@pytest.mark.parametrize("text", ["", "[]", "{}", "[" * 100_000])
def test_a_broken_file_is_none(tmp_path: Path, text: str) -> None:
    assert stored(tmp_path, text) == RandomSearches()


@pytest.mark.parametrize(
    ("other", "is_same"),
    [({}, True), ({"reading": "as_coded"}, False), ({"sources": {"target": "b"}}, False)],
)
def test_searches_in_another_reading_inject_other_faults(other: dict[str, Any], is_same: bool) -> None:
    """The same names and values mean other faults there."""
    head = {"sources": {"target": "a"}, "reading": "as_described"}
    runs = [SimpleNamespace(head=SimpleNamespace(**values)) for values in (head | other, head)]
    assert random_searches._injects_the_same(*runs) is is_same  # type: ignore[arg-type]
