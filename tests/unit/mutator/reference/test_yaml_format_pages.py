"""docs/reference/formats.md and the code list the same formats."""

import importlib.util
import re
from pathlib import Path

from mutator._common import cache_layout_and_pruning

CLONE = Path(__file__).parents[4]
PAGE = (CLONE / "docs" / "reference" / "formats.md").read_text(encoding="utf-8")
SCHEMA = re.compile(r"([a-z][a-z_-]*/[1-9]\d*)")
IN_CODE = re.compile(rf"""["']{SCHEMA.pattern}["']""")
IN_PAGE = re.compile(rf"`{SCHEMA.pattern}`")


def in_code() -> set[str]:
    """Return every `name/number` string literal in the harness or the shipped target."""
    files = [*(CLONE / "mutator").rglob("*.py"), *(CLONE / "target").rglob("*.py")]
    assert len(files) > 250
    return {name for file in files for name in IN_CODE.findall(file.read_text(encoding="utf-8"))}


def test_the_page_lists_every_schema_of_the_code() -> None:
    assert {"run/1", "sim-record/1", "film-events/1"} <= in_code() <= set(IN_PAGE.findall(PAGE))


def test_every_schema_in_the_page_is_in_the_code() -> None:
    assert set(IN_PAGE.findall(PAGE)) - in_code() == set()


def test_every_module_in_the_page_exists() -> None:
    modules = set(re.findall(r"`((?:mutator|selfdrive)\.[\w.]+)`", PAGE))
    assert len(modules) > 40
    assert sorted(name for name in modules if importlib.util.find_spec(name) is None) == []


def test_the_page_lists_every_cache() -> None:
    table = PAGE.split("\n## Caches\n")[1].split("\n## ")[0]
    folders = set(re.findall(r"^\| `([^/`]+)/", table, re.MULTILINE))
    parts = {
        cache_layout_and_pruning.CHECKS_CACHE,
        cache_layout_and_pruning.GOLDENS_CACHE,
        cache_layout_and_pruning.EXECUTED_LINES_CACHE,
        cache_layout_and_pruning.FINISHED_RUNS_CACHE,
        cache_layout_and_pruning.CAMPAIGN_RUNS_CACHE,
        cache_layout_and_pruning.REPORTS_CACHE,
        cache_layout_and_pruning.IMAGE_EFFECTS_CACHE,
        cache_layout_and_pruning.VERIFIED_RUNS_CACHE,
    }
    assert folders == {*parts, cache_layout_and_pruning.TARGET_CACHES}


def test_the_page_lists_the_schema_of_every_library_file() -> None:
    files = [*(CLONE / "fault_library").rglob("*.yaml"), *(CLONE / "templates").glob("*.yaml")]
    heads = {re.search(rf"^schema: {SCHEMA.pattern}$", file.read_text(), re.MULTILINE) for file in files}
    assert {found and found[1] for found in heads} <= set(IN_PAGE.findall(PAGE))
