"""Building the report of a run folder."""

import base64
import gzip
import json
import re
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

from mutator._common.files import write_json
from mutator._common.folder_locks import OWNER_LOCK_FILE
from mutator.errors import MutatorError, UnsafePath
from mutator.figures.figure_style import with_page_theme
from mutator.report import report_builder
from mutator.report.panels import failed_runs_panel
from mutator.report.report_digests import inputs_digest
from mutator.store import recorded_approvals
from mutator.store.run_folder import STOP_AT_HAZARD_NOTE, RunFolder
from mutator.workspace import Workspace
from tests.made_up_results import write_results

from .made_run import COLUMNS, HEAD, LINES, OK, PATCH, Page, make_run

STAMPS = ('{"schema": "report/1", "files": 1}', '{"schema": "report/1", "files": {"../run.json": ""}}')
HERE = Workspace.find(Path(__file__).parents[4])


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """A made-up run of a campaign that requests no study."""
    return make_run(tmp_path)


def test_harness_errors_are_counted_separately(run: Path) -> None:
    text = report_builder.write_report(run, None).markdown.read_text()
    assert "3 experiments: 1 hazard, 1 crashed, 1 harness_error." in text
    failed = text.split("## Runs that did not finish normally")[1]
    assert failed.index("harness_error") < failed.index("crashed")
    assert "the disk \\| is &lt;gone>" in failed
    counts = text.split("## By fault type")[1].split("##")[0]
    [line] = [line for line in counts.splitlines() if line.startswith("| radar/chaff ")]
    assert line == "| radar/chaff | 2 | 2 | 2 | 1 | 0 | 0 | 1 | 0 | 1 | 1 | 1 |"


def test_the_page_is_well_formed_and_escaped(run: Path) -> None:
    page = Page(report_builder.write_report(run, None).page.read_text())
    assert page.open == []
    assert "night_<b>drive</b>" in page.texts
    assert "the disk | is <gone>" in page.texts


def carried(page: Path, name: str) -> Any:
    [text] = re.findall(rf'id="{name}">([^<]*)</script>', page.read_text())
    return json.loads(gzip.decompress(base64.b64decode(text)))


def test_the_page_needs_no_other_file_and_links_only_to_pages_beside_it(run: Path) -> None:
    written = report_builder.write_report(run, None)
    page = Page(written.page.read_text())
    assert page.links
    others = {link for link in page.links if not link.startswith(("#", "data:"))}
    assert others == {"tables.html", "origin.html"}
    for name in others:
        beside = Page((run / "report" / name).read_text())
        assert beside.open == []
        assert {link for link in beside.links if not link.startswith(("#", "data:"))} == {
            "index.html",
            *others,
        }
    text = written.page.read_text().replace("http://www.w3.org/2000/svg", "")
    assert "http" not in text.replace("/*! https://github.com/leeoniya/uPlot", "")


def test_the_page_contains_results_diff_and_still_of_an_experiment(
    run: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stored = {"0" * 16: PATCH.encode()}
    monkeypatch.setattr(RunFolder, "read_patch", lambda self, name, record: stored.get(name))
    page = report_builder.write_report(run, None).page
    table = carried(page, "table")
    columns = {column["name"]: column for column in table["columns"]}
    assert table["count"] == 3
    assert {column.name for column in COLUMNS} < columns.keys()
    ids = columns["experiment_id"]["texts"]
    at = ids.index("0" * 16)
    assert columns["t_h1"]["numbers"][at] == 18.25
    details = carried(page, "details")
    shape = details["shapes"][details["shape"][at]]
    assert "".join(shape["parts"]) == PATCH[PATCH.index("diff --git a/pkg/radar.py") :]
    [[time, picture]] = carried(page, "media")["0" * 16]["stills"]
    assert time == "14.50"
    assert base64.b64decode(picture.partition(",")[2]) == b"picture"


def test_a_link_leads_to_failed_runs_that_are_not_listed(run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(failed_runs_panel, "MOST_RUNS_ON_PAGE", 1)
    text = report_builder.write_report(run, None).page.read_text()
    assert "1 more: " in text
    assert "#status=crashed,timeout,invalid_mutant,harness_error" in text


def test_the_report_states_its_origin(run: Path) -> None:
    written = report_builder.write_report(run, None)
    for text in (written.markdown.read_text(), (run / "report" / "origin.html").read_text()):
        for fact in ("ab" * 32, "cd" * 32, "as_described", "chosen: limit", "3 of 3 planned", "2.4.6"):
            assert fact in text


def test_the_report_names_the_reviewers(run: Path) -> None:
    assert "reviewed" not in report_builder.write_report(run, None).markdown.read_text()
    said = {
        "schema": recorded_approvals.APPROVALS_SCHEMA,
        "target": "toycar",
        "groups": [{"by": "Jane"}, {"by": "Joe"}],
    }
    write_json(run / recorded_approvals.APPROVALS_FILE, said)
    written = report_builder.ensure_report(run, None)
    for text in (written.markdown.read_text(), (run / "report" / "origin.html").read_text()):
        assert "2 groups approved by Jane (1), Joe (1)" in text


def test_the_report_is_reproducible(run: Path) -> None:
    written = report_builder.write_report(run, None)
    before = written.page.read_bytes(), written.markdown.read_bytes()
    again = report_builder.write_report(run, None)
    assert (again.page.read_bytes(), again.markdown.read_bytes()) == before


def test_a_folder_without_a_run_gets_no_report(tmp_path: Path) -> None:
    with pytest.raises(MutatorError, match="not a run folder"):
        report_builder.write_report(tmp_path, None)


def test_figures_are_in_the_markdown_and_on_a_page_of_their_own(run: Path) -> None:
    other = OK | {"experiment_id": "3" * 16, "fault_id": "f3", "fault_type": "jamming", "scenario": "S2"}
    write_results(run, COLUMNS, [*LINES, other])
    written = report_builder.write_report(run, None)
    page = run / "report" / "figures.html"
    shown = [link for link in Page(page.read_text()).links if link.startswith("data:image/svg")]
    files = sorted((run / "report" / "figures").glob("*.svg"))
    embedded = [base64.b64decode(link.partition(",")[2]).decode() for link in shown]
    assert sorted(embedded) == sorted(with_page_theme(file.read_text()) for file in files)
    assert len(shown) == 1
    assert written.markdown.read_text().count("](figures/") == 1


def test_experiments_and_runs_are_counted_separately(run: Path) -> None:
    assert "Planned: 3 experiments, in 2 runs" in report_builder.write_report(run, None).markdown.read_text()
    (run / "run.json").write_text(json.dumps(HEAD | {"runs": 3}))
    assert (
        "Planned: 3 experiments, no two with identical runs.\n"
        in report_builder.write_report(run, None).markdown.read_text()
    )


def test_the_report_says_what_stopped_runs_might_have_missed(run: Path) -> None:
    """If a run stops at a hazard, later alerts are unknown."""
    assert STOP_AT_HAZARD_NOTE not in report_builder.write_report(run, None).markdown.read_text()
    stops = {"canary": {"after_hazard": "stop"}, "alerts": ["fcw"]}
    (run / "run.json").write_text(json.dumps(HEAD | stops))
    written = report_builder.write_report(run, None)
    assert written.markdown.read_text().count(STOP_AT_HAZARD_NOTE) == 3
    assert f"share one run. {STOP_AT_HAZARD_NOTE}" in written.markdown.read_text()
    assert STOP_AT_HAZARD_NOTE in written.page.read_text()


def drawn_again(run: Path, workspace: Workspace | None) -> bool:
    page = run / "report" / "index.html"
    before = page.stat().st_mtime_ns if page.exists() else None
    report_builder.ensure_report(run, workspace)
    return page.stat().st_mtime_ns != before


def test_an_up_to_date_report_is_not_written_again(run: Path) -> None:
    assert drawn_again(run, None)
    assert not drawn_again(run, None)
    (run / OWNER_LOCK_FILE).write_text("4711")  # as each process that opens the run leaves it
    assert not drawn_again(run, None)
    (run / "plots" / ("2" * 16 + ".svg")).touch()
    assert drawn_again(run, None)
    (run / "series/kept").mkdir(parents=True)
    (run / "series/kept" / ("2" * 16 + ".js")).touch()
    assert drawn_again(run, None)
    assert not drawn_again(run, None)
    write_results(run, COLUMNS, [LINES[0] | {"t_h1": "18.26"}, *LINES[1:]])
    assert drawn_again(run, HERE)


@pytest.mark.parametrize("name", ["REPORT.md", "index.html", "tables/times_to_hazard.csv"])
def test_a_report_that_was_edited_is_written_again(run: Path, name: str) -> None:
    out = run / "report"
    report_builder.write_report(run, None)
    (out / "compare-other").mkdir()
    (out / "compare-other" / "index.html").write_text("another command's")
    assert not drawn_again(run, None)
    (out / name).write_text((out / name).read_text() + "edited")
    assert drawn_again(run, None)


def test_a_report_can_be_built_without_writing(run: Path) -> None:
    built = report_builder.build_report(RunFolder.open(run), None)
    assert not (run / "report").exists()
    report_builder.write_report(run, None)
    out = run / "report"
    written = {path.relative_to(out).as_posix(): path.read_bytes() for path in out.rglob("*.*")}
    del written["made_from.json"]
    assert written == built.files


def test_files_of_an_earlier_report_are_deleted(run: Path) -> None:
    """A report of other results can have fewer tables. Files that no report wrote are kept."""
    out = run / "report"
    report_builder.write_report(run, None)
    (out / "tables" / "mine.csv").touch()
    write_results(run, COLUMNS, [])
    report_builder.write_report(run, None)
    assert [path.name for path in (out / "tables").iterdir()] == ["mine.csv"]


@pytest.mark.parametrize("name", ["report", "report/tables", "report/index.html"])
def test_a_report_is_not_written_through_a_link(run: Path, tmp_path: Path, name: str) -> None:
    elsewhere = tmp_path / "elsewhere"
    report_builder.write_report(run, None)
    (run / name).rename(elsewhere)
    (run / name).symlink_to(elsewhere)
    before = {path: path.stat().st_mtime_ns for path in (elsewhere, *elsewhere.rglob("*"))}
    with suppress(UnsafePath):
        report_builder.write_report(run, None)
    assert before == {path: path.stat().st_mtime_ns for path in (elsewhere, *elsewhere.rglob("*"))}


def test_inputs_of_a_report_are_not_read_without_limit(run: Path) -> None:
    """A sparse file takes no space on the disk. What does not belong in a run folder is not opened."""
    for name in ("huge.bin", "work/huge.bin", "records/huge.jsonl"):
        (run / name).parent.mkdir(exist_ok=True)
        with (run / name).open("wb") as file:
            file.truncate(4_000_000_000_000)
    with pytest.raises(MutatorError, match=r"records/huge\.jsonl: 4,000,000,000,000 bytes"):
        inputs_digest(RunFolder.open_unverified(run), None)
    (run / "records/huge.jsonl").unlink()
    assert inputs_digest(RunFolder.open_unverified(run), None)


@pytest.mark.parametrize("text", ["{", "[1]", '{"schema": "report/1"}', *STAMPS])
def test_a_damaged_list_of_inputs_causes_a_new_report(run: Path, text: str) -> None:
    report_builder.write_report(run, None)
    (run / "report" / "made_from.json").write_text(text)
    assert drawn_again(run, None)


@pytest.mark.parametrize("damage", ["REPORT.md", "made_from.json"])
def test_an_incomplete_report_is_written_again(run: Path, damage: str) -> None:
    report_builder.write_report(run, None)
    (run / "report" / damage).unlink()
    assert drawn_again(run, None)


@pytest.mark.parametrize("workspace", [HERE, None], ids=["library", "no library"])
def test_published_fault_types_alone_add_no_published_numbers(run: Path, workspace: Workspace | None) -> None:
    written = report_builder.write_report(run, workspace)
    page = re.sub(r"(?s)<(style|script).*?</\1>", "", written.page.read_text())
    shown = written.markdown.read_text() + page
    assert not {"paper", "observation", "study"} & set(re.findall(r"[a-z]+", shown.lower()))
    assert not (run / "report" / "observations.md").exists()
    tables = {path.name for path in (run / "report").glob("tables/*")}
    # computed from the hazards of this run
    assert tables == {"times_to_hazard.csv", "times_to_hazard.md"}


@pytest.mark.parametrize("workspace", [HERE, None], ids=["library", "no library"])
def test_a_study_that_cannot_be_evaluated_is_left_out_with_the_reason(
    tmp_path: Path, workspace: Workspace | None
) -> None:
    text = report_builder.write_report(
        make_run(tmp_path, study="moon_landing"), workspace
    ).markdown.read_text()
    assert ("moon_landing, which cannot be loaded here" in text) == (workspace is not None)
    assert ("moon_landing, which needs a fault library" in text) == (workspace is None)


def test_the_report_shows_the_spread_of_several_seeds(run: Path) -> None:
    assert report_builder.write_report(run, None).summaries == ()
    more = [line | {"experiment_id": f"{i}a" * 8, "seed": str(9 + i)} for i, line in enumerate(LINES)]
    write_results(run, COLUMNS, [line | {"seed": "2"} for line in LINES] + more)
    written = report_builder.write_report(run, None)
    assert "## Seeds\n\n3 seeds (2 to 11). Each seed repeats" in written.markdown.read_text()
    assert '<section class="part" id="seeds">' in (run / "report" / "tables.html").read_text()
    assert (run / "report" / "tables" / "seeds_by_fault_type.csv").is_file()
    assert (
        (run / "report" / "tables" / "seeds.csv").read_text().startswith("faults,what,of,all seeds: count,")
    )
    [summary] = written.summaries
    rows = {row[0]: row for row in summary.rows}
    assert rows["hazards / activated"][3:] == ["0.0 % (seed 11)", "100.0 % (seed 9)"]
