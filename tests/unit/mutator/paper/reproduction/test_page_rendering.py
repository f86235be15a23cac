"""Pages of the study have no number that is not in a table."""

import re
from dataclasses import replace

import pytest

from mutator.errors import MutatorError
from mutator.paper.reproduction.page_rendering import StudyPages
from mutator.paper.reproduction.study_clone import DIFFERENCES_PAGE
from mutator.paper.reproduction.study_tables import Row, StudyTables

from .made_up_study import CLONE, made_up_pages

BLOCK = "<!-- study: {} -->\n<!-- end of study -->"


def with_cells(study: StudyPages, name: str, row_index: int, **cells: str) -> StudyPages:
    """Return the study with other cells in one row of a table."""
    rows: list[Row] = list(study.tables.rows(name))
    rows[row_index] = dict(rows[row_index]) | cells
    return replace(study, tables=StudyTables(rows_by_name=dict(study.tables.rows_by_name) | {name: rows}))


def test_every_block_of_the_page_is_rendered_from_tables() -> None:
    page = (CLONE / DIFFERENCES_PAGE).read_text(encoding="utf-8")
    names = re.findall(r"<!-- study: (\w+) -->", page)
    assert names == ["summary", "agreement", "alerts", "counts", "seeds", "seed_verdicts", "observations"]
    assert page.count("<!-- end of study -->") == len(names)
    rendered = made_up_pages().with_blocks(page)
    assert rendered != page and made_up_pages().with_blocks(rendered) == rendered


def test_a_block_that_no_table_fills_is_refused() -> None:
    with pytest.raises(MutatorError, match="a block 'weather'"):
        made_up_pages().with_blocks(BLOCK.format("weather"))


def test_a_campaign_with_the_papers_counts_agrees_with_it() -> None:
    columns = [line.split(" | ") for line in made_up_pages().agreement_table().splitlines()]
    within, others, _, _, _, equal = (cells[2] for cells in columns[2:])
    assert (within, others, equal) == ("17 of 17", "none", "all")


def test_alerts_far_from_the_papers_are_bold() -> None:
    """333 of 797 in S2, the paper's count, and 433: 12.5 points more."""
    study = made_up_pages()
    places = [(row["campaign"], row["method"], row["scenario"]) for row in study.tables.rows("scenarios")]
    changed = with_cells(study, "scenarios", places.index(("coded", "guided", "S2")), alerts="433")
    lines = {line.split(" | ")[0].strip("| "): line for line in changed.alerts_table().splitlines()}
    assert "54.3 % (**+13**)" in lines["as coded"] and "41.8 % (+0)" in lines["as described"]


def test_the_results_page_names_runs_digests_and_fault_free_alerts() -> None:
    page = made_up_pages().results_page()
    for text in (
        "`coded_2_75`",
        "`" + "c" * 64 + "`",
        "S2 (as coded): fcw at 2.00 s",
        "commit `" + "ab" * 6 + "`",
    ):
        assert text in page, text
    assert made_up_pages().tables.digest() in page and "| 1.1* |" in page
    assert "of the 7 fault-free runs" in page and "ten seeds of a tenth) with seed 1, 2: fcw" in page


def test_the_summary_says_by_rules_which_campaigns_are_near() -> None:
    study = made_up_pages()
    assert "* hazards within ten points of the paper's: as described; as coded; " in study.summary_table()
    rows = [row for row in study.tables.rows("scenarios") if row["method"] == "guided"]
    for row in rows:
        if row["campaign"] == "described":
            place = study.tables.rows("scenarios").index(row)
            study = with_cells(study, "scenarios", place, hazards="0", hazards_no_alerts="0", alerts="0")
    text = study.summary_table()
    assert "* hazards within ten points of the paper's: as coded; " in text
    assert "with its whole interval: as described; as coded" in text


def test_what_the_page_says_of_alerts_is_what_its_table_shows() -> None:
    """On the reference plant, S2 and S4 have too many alerts, S5 too few, and the total is the paper's."""
    page = (CLONE / DIFFERENCES_PAGE).read_text(encoding="utf-8")
    block = page.split("<!-- study: alerts -->", 1)[1].split("<!-- end of study -->", 1)[0]
    [line] = [line for line in block.splitlines() if line.startswith("| as coded, reference plant |")]
    differences = re.findall(r"\((\*{0,2})([+-]\d+)\*{0,2}\)", line)
    is_far = [bool(stars) for stars, _ in differences]
    assert [is_far[index] for index in (1, 3, 4, 5)] == [True, True, True, False]
    points = [int(number) for _, number in differences]
    assert points[1] > 0 and points[3] > 0 and points[4] < 0
