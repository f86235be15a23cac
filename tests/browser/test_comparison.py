"""The page of a comparison with more changes than the page shows."""

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from mutator.comparison import comparison_files
from mutator.comparison.run_comparison_and_gates import Comparison, compare_runs
from mutator.model import Experiment, Outcome
from mutator.workspace import Workspace

HAZARD = {"outcome": Outcome.HAZARD, "hazards": (("H1", 4.0),)}
COPIES = 8  # of each of the toy's 24 pairs
SHOWN = 60


def worse(e: Experiment) -> dict[str, Any]:
    return HAZARD if e.fault.fault_type == "silence" else {"outcome": Outcome.SDC}


@pytest.fixture
def found(toycar: Workspace, tmp_path: Path, write_run: Callable[..., Path]) -> Comparison:
    few = compare_runs(write_run(toycar, tmp_path / "before"), write_run(toycar, tmp_path / "after", worse))
    return dataclasses.replace(
        few, matching=dataclasses.replace(few.matching, pairs=few.matching.pairs * COPIES)
    )


@pytest.mark.slow
def test_a_long_comparison_is_cut_and_can_be_filtered(
    browser: Any,
    found: Comparison,
    tmp_path: Path,
    serious_faults: Callable[[Any], list[str]],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(comparison_files, "MOST_SHOWN_ROWS", SHOWN)
    page = browser.new_page()
    errors: list[str] = []
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.goto(comparison_files.write_comparison(found, tmp_path / "out").page.as_uri())
    total, seen = len(found.changed_pairs), page.locator("#changed tr:visible")
    assert total == 24 * COPIES
    assert seen.count() == 1 + SHOWN
    assert "silence" in seen.nth(1).inner_text()
    assert page.inner_text("#shown") == f"{total} of {total}, the first {SHOWN} are shown"
    last = found.changed_pairs[-1].b
    page.fill("#words", last.id)
    assert seen.count() == 1 + COPIES
    assert last.fault.spec in seen.nth(1).inner_text()
    page.fill("#words", "")
    page.click("[data-change=new-hazard]")
    hazards = sum(pair.b.fault.fault_type == "silence" for pair in found.pairs)
    assert page.inner_text("#shown").startswith(f"{hazards} of {total}")
    page.emulate_media(color_scheme="dark", reduced_motion="reduce")
    assert serious_faults(page) == []
    page.close()
    assert errors == []
