"""The change against the run before, on the first screen of a report."""

import json
import shutil
from pathlib import Path

import pytest

from mutator._common.message_text import with_unbreakable_numbers
from mutator.report import report_builder
from mutator.report.change_since_run_before import ChangeSinceRunBefore, find_change, stored_change
from mutator.report.report_audit import audit_report
from mutator.results.table_reader import Results
from mutator.store.run_folder import RunFolder

from .made_run import make_two_runs

FIRST, SECOND = "0" * 16, "1" * 16


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    make_two_runs(tmp_path)
    return tmp_path


def change_of(run: Path) -> ChangeSinceRunBefore | None:
    return find_change(RunFolder.open(run), Results(run).frame())


def test_a_run_is_compared_with_the_latest_earlier_run_of_its_plan(folder: Path) -> None:
    expected = ChangeSinceRunBefore(
        name="before",
        date="2026-11-24 01:02",
        target_commit="-",
        new_hazard_ids=(SECOND,),
        former_hazard_ids=(FIRST,),
        changed_count=0,
        shared_count=3,
    )
    assert change_of(folder / "after") == expected
    assert change_of(folder / "before") is None


@pytest.mark.parametrize("key", ["plan", "campaign"])
def test_a_run_of_another_plan_or_campaign_is_not_the_run_before(folder: Path, key: str) -> None:
    path = folder / "before" / "run.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {key: "ef" * 32}))
    assert change_of(folder / "after") is None


def test_a_run_before_without_results_is_left_out(folder: Path) -> None:
    for name in ("results.csv", "results.parquet"):
        (folder / "before" / name).unlink()
    assert change_of(folder / "after") is None


def test_the_first_screen_says_what_changed_and_links_to_it(folder: Path) -> None:
    written = report_builder.write_report(folder / "after", None)
    text, page = written.markdown.read_text(), written.page.read_text()
    said = "1 new hazard, 1 gone, 0 changed otherwise, of 3 experiments that are also in before"
    assert f"**Since the run before:** {said} (2026-11-24 01:02 UTC)." in text
    assert (
        with_unbreakable_numbers(said) in page
        and f'new: <a href="#e={SECOND}">' in page
        and f'gone: <a href="#e={FIRST}">' in page
    )
    assert "<code>mutator compare before after</code>" in page
    assert "Since the run before" not in report_builder.write_report(folder / "before", None).page.read_text()


def test_equal_runs_have_no_difference(folder: Path) -> None:
    for name in ("results.csv", "results.parquet", "results.json"):
        if (folder / "before" / name).exists():
            shutil.copy(folder / "before" / name, folder / "after" / name)
    text = report_builder.write_report(folder / "after", None).markdown.read_text()
    assert "**Since the run before:** no difference, of 3 experiments" in text


def test_a_report_is_built_again_without_the_run_before(folder: Path) -> None:
    """A run folder that was moved still proves its report; the origin names what nothing in it proves."""
    report_builder.write_report(folder / "after", None)
    shutil.rmtree(folder / "before")
    run = RunFolder.open(folder / "after")
    assert stored_change(run) is not None
    assert list(audit_report(run, None)[1]) == []
    assert (
        "before, with which the report compares this run" in (run.path / "report" / "origin.html").read_text()
    )
    path = run.path / "report" / "run_before.json"
    path.write_text(path.read_text().replace('"shared_count": 3', '"shared_count": 4'))
    assert len(list(audit_report(run, None)[1])) == 2  # the two forms of the first screen
    path.write_text("{")
    assert stored_change(run) is None
