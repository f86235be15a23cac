"""The history of the runs in a folder."""

import json
import os
import shutil
from pathlib import Path

import pytest

from mutator.errors import MutatorError
from mutator.report.run_history import write_history

from .made_run import Page, make_two_runs


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    make_two_runs(tmp_path)
    (tmp_path / "broken").mkdir()
    shutil.copy(tmp_path / "before" / "run.json", tmp_path / "broken")
    return tmp_path


def test_changes_between_runs_are_counted(folder: Path) -> None:
    written = write_history(folder)
    text = written.markdown.read_text()
    assert written.runs == 2
    assert "before to after: 1 new hazard, 1 gone, 0 changed otherwise, of 3 shared." in text
    assert f"`mutator compare {folder / 'before'} {folder / 'after'}`" in text
    assert text.index("| after |") < text.index("| before |"), "the newest run is not first"
    assert "| 2026-11-24 02:02 | - | 3 of 3 | 1 of 3 activated | - | 1 of 1 |" in text


def test_a_run_keeps_its_date_when_it_is_copied(folder: Path) -> None:
    before = write_history(folder).markdown.read_bytes()
    for path in folder.rglob("*"):
        os.utime(path, (0, 0))
    assert write_history(folder).markdown.read_bytes() == before


def test_a_run_of_an_older_version_has_no_date_and_is_the_oldest(folder: Path) -> None:
    shutil.rmtree(folder / "after" / "timings")
    text = write_history(folder).markdown.read_text()
    assert "| after | - | - | 3 of 3 |" in text
    assert text.index("| before |") < text.index("| after |")


def test_a_plan_that_has_not_run_yet_is_no_error(folder: Path) -> None:
    head = json.loads((folder / "after" / "run.json").read_text())
    (folder / "after" / "run.json").write_text(json.dumps(head | {"stretches": []}))
    assert write_history(folder).runs == 2


def test_a_command_quotes_the_names_of_runs(folder: Path) -> None:
    (folder / "before").rename(folder / "the night before")
    written = write_history(folder)
    assert (
        f"`mutator compare '{folder / 'the night before'}' {folder / 'after'}`"
        in written.markdown.read_text()
    )


def test_a_folder_without_results_is_named(folder: Path) -> None:
    written = write_history(folder)
    [why] = written.left_out
    assert why.startswith("broken: ")
    assert why in written.markdown.read_text()
    assert why in " ".join(Page(written.page.read_text()).texts)


def test_the_page_links_to_existing_reports_and_comparisons(folder: Path) -> None:
    for page in ("after/report/index.html", "after/report/compare-before/index.html"):
        (folder / page).parent.mkdir(parents=True, exist_ok=True)
        (folder / page).write_text("")
    written = write_history(folder)
    links = Page(written.page.read_text()).links
    assert sorted(links) == ["after/report/compare-before/index.html", "after/report/index.html", "data:,"]


def test_a_folder_without_runs_is_an_error(folder: Path) -> None:
    with pytest.raises(MutatorError, match="there is no run folder here"):
        write_history(folder / "before" / "plots")
