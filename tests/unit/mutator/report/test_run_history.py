"""The history of the runs in a folder."""

import os
import shutil
from pathlib import Path

import pytest

from mutator.errors import MutatorError
from mutator.report.run_history import write_history
from tests.made_up_results import write_results

from .made_run import COLUMNS, NONE, OK, Page, make_run


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    calm = OK | NONE | {"outcome": "masked"}
    for hour, (name, lines) in enumerate((("before", (OK, calm, calm)), ("after", (calm, OK, calm))), 1):
        (tmp_path / name).mkdir()
        run = make_run(tmp_path / name)
        named = [{"experiment_id": f"{i}" * 16, "fault_id": "f"} | line for i, line in enumerate(lines)]
        write_results(run, COLUMNS, named)
        os.utime(run / "results.parquet", (3600 * hour, 3600 * hour))
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
    assert "| 1970-01-01 02:00 | - | 3 of 3 | 1 of 3 activated | - | 1 of 1 |" in text


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
