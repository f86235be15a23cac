"""The history of the runs in a folder."""

import json
import os
import shutil
from pathlib import Path

import pytest

from mutator.errors import MutatorError
from mutator.report.run_history import write_history
from mutator.store.checksummed_lines import LineWriter
from mutator.store.timings import TIMINGS_SCHEMA
from tests.made_up_results import write_results

from .made_run import COLUMNS, HEAD, NONE, OK, Page, make_run

COST = {"cpu_s": 1.0, "wall_s": 1.0, "host": "h", "worker": "a", "engine": "reference", "why": ""}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    calm = OK | NONE | {"outcome": "masked"}
    for hour, (name, lines) in enumerate((("before", (OK, calm, calm)), ("after", (calm, OK, calm))), 1):
        (tmp_path / name).mkdir()
        run = make_run(tmp_path / name)
        named = [{"experiment_id": f"{i}" * 16, "fault_id": "f"} | line for i, line in enumerate(lines)]
        write_results(run, COLUMNS, named)
        timings = LineWriter(
            run / "timings" / "0001-a.jsonl", {"schema": TIMINGS_SCHEMA, "plan": HEAD["plan"]}
        )
        for line in named[::-1]:  # the last line is not the last experiment that ended
            ended = f"2026-11-24T{hour:02}:0{line['experiment_id'][0]}:00Z"
            timings.append(COST | {"experiment_id": line["experiment_id"], "ended": ended})
        timings.close()
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
