"""Pages of the study have no number that is not in a table."""

import re
from dataclasses import replace

import pytest

from mutator.errors import MutatorError
from mutator.paper.reproduction.page_rendering import StudyPages
from mutator.paper.reproduction.study_clone import DIFFERENCES_PAGE, TABLES_FOLDER
from mutator.paper.reproduction.study_tables import Row, StudyTables, load_tables
from mutator.paper.reproduction.tally_texts import NEAR_POINTS

from .made_up_study import CLONE, made_up_pages

TABLES = CLONE / TABLES_FOLDER
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
    """On the reference plant, S2 and S4 have too many alerts, S3 and S5 too few, and the total is near the
    paper's. On the standard plant, each scenario has too few.
    """
    page = (CLONE / DIFFERENCES_PAGE).read_text(encoding="utf-8")
    block = page.split("<!-- study: alerts -->", 1)[1].split("<!-- end of study -->", 1)[0]
    points_by_title = {
        line.split(" | ")[0].strip("| "): [int(n) for n in re.findall(r"\(\**([+-]\d+)\**\)", line)]
        for line in block.splitlines()
    }
    for title in ("as coded, reference plant", "as coded, reference plant, threshold 2.75"):
        _, second, third, fourth, fifth, total = points_by_title[title]
        assert second > NEAR_POINTS and fourth > 0 and abs(total) <= NEAR_POINTS, title
        assert third < -NEAR_POINTS and fifth < -NEAR_POINTS, title
    for title in ("as described", "as coded", "as coded, threshold 2.75"):
        assert max(points_by_title[title]) < -NEAR_POINTS, title


def test_what_the_page_says_of_counts_is_what_their_table_shows() -> None:
    """Each sentence that judges a count in *Alerts by scenario* and *What differs, and why*."""
    shares: dict[str, dict[str, float]] = {}
    texts: dict[str, dict[str, str]] = {}
    for row in load_tables(TABLES).rows("explaining_counts"):
        name, what, count = row["campaign"], row["what"], row["count"]
        texts.setdefault(name, {})[what] = count
        if match := re.match(r"(\d+) of (\d+)", count):
            shares.setdefault(name, {})[what] = int(match[1]) / int(match[2])
    slower, faster = (f"speed, {each}: hazards, and the first ones" for each in ("slower", "faster"))
    early, late = (f"path model, random, {each}: hazards" for each in ("before 24 s", "later"))
    [unchanged] = [what for what in shares["coded"] if what.startswith("not manifested")]
    for name, counts in shares.items():
        assert counts["camera's distance, both methods: manifested"] == 0, name
        assert counts[unchanged] > 0.5 and counts[early] > counts[late], name
        assert counts["alerts: steer_saturated alone"] > 0.5, name
        assert counts["invisible vehicle in C2: hazards"] >= 0.85, name
        assert counts["invisible vehicle in C4: hazards"] <= 0.4, name
        assert counts["invisible vehicle in C1: hazards"] == 0, name
        assert counts["invisible vehicle in C3: hazards"] <= 1 / 24, name
        pairs = "camera frames: scenarios and contexts with an activated fault"
        assert texts[name][pairs] == "18", name
    assert shares["described"]["camera frames: alerts"] < 0.01
    assert shares["coded"][slower] < shares["described"][slower]
    assert texts["coded"][faster] == "30 of 30 (H3 30)" and shares["reference"][faster] == 0
    what = "path model: median time from alert to hazard"
    times = {name: float(counts[what].split(" s ")[0]) for name, counts in texts.items()}
    assert times["coded"] < 0.5 * times["reference"]


def test_one_claim_alone_decides_the_first_observation_as_described() -> None:
    claims = load_tables(TABLES).rows("claims", campaign="described", observation="1", needed="yes")
    assert {row["claim"]: row["claim_verdict"] for row in claims} == {
        "1.1": "holds",
        "1.2": "holds",
        "1.3": "does not hold",
    }
