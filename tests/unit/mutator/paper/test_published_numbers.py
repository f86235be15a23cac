"""The paper's counts, as cited, and tables that compare them with ours."""

import csv
import io
from pathlib import Path

import pytest

from mutator.errors import MutatorError
from mutator.paper.published_numbers import PublishedNumbers, load_published_numbers
from mutator.statistics import guided_against_random
from mutator.statistics.guided_against_random_tables import hazard_odds_sheet, hazards_by_fault_type_sheet
from mutator.statistics.shares_with_intervals import share_with_interval
from mutator.statistics.summary_tables import coverage_sheet, summary_sheet
from mutator.statistics.tallies import Tally, sum_tallies, tally_by_fault_type, tally_by_scenario

from ..statistics.results_frame import results

REFERENCES = Path(__file__).parents[4] / "fault_library" / "references"
HIT = {"t_activation": 7.0, "t_manifest": 7.1, "h1": 1, "t_h1": 18.0}


@pytest.fixture(scope="module")
def paper() -> PublishedNumbers:
    return load_published_numbers(REFERENCES)


def of(counts: dict[tuple[str, str], Tally], method: str) -> Tally:
    return sum_tallies(one for (how, _), one in counts.items() if how == method)


def test_the_cited_tables_have_the_sums_that_the_paper_gives(paper: PublishedNumbers) -> None:
    assert of(paper.tally_by_scenario, "guided") == Tally(
        injected=5640,
        activated=3678,
        manifested=3656,
        hazards=1316,
        alerts=1570,
        hazards_no_alerts=402,
        alerts_no_hazards=656,
    )
    assert of(paper.tally_by_scenario, "random").hazards == 1634
    for method in ("guided", "random"):
        types, scenarios = of(paper.tally_by_fault_type, method), of(paper.tally_by_scenario, method)
        assert (types.injected, types.hazards) == (scenarios.injected, scenarios.hazards)
        assert types.activated == scenarios.activated


def test_the_guided_advantage_reverses_per_injected_fault(paper: PublishedNumbers) -> None:
    guided, random = of(paper.tally_by_scenario, "guided"), of(paper.tally_by_scenario, "random")
    rates = [
        round(100 * share_with_interval(one.hazards, whole).rate, 1)
        for one, whole in (
            (guided, guided.activated),
            (random, random.activated),
            (guided, guided.injected),
            (random, random.injected),
        )
    ]
    assert rates == [35.8, 29.0, 23.3, 29.0]


def test_our_counts_are_in_the_row_below_the_papers(paper: PublishedNumbers) -> None:
    frame = results(HIT, HIT | {"alerts": "fcw", "t_alert": 9}, {}, {"scenario": "S9", "t_activation": 2})
    lines = summary_sheet("guided", tally_by_scenario(frame), paper.as_published_counts()).table().rows
    hazards = [line[2:] for line in lines if line[:2] == ["hazards", "activated"]]
    assert hazards[0][:3] == ["paper", "35.1 % (215/613; 31.4 to 38.9)", "-"]
    assert hazards[1][0] == "here"
    assert [cell.split(";")[0] for cell in hazards[1][1:]] == [
        "100.0 % (2/2",
        "0.0 % (0/1",
        "66.7 % (2/3",
    ]
    unwarned = next(line for line in lines if line[:3] == ["hazards without alert", "hazards", "here"])
    assert unwarned[3].startswith("50.0 % (1/2;")


def test_hazards_are_given_per_activated_and_per_injected_fault(paper: PublishedNumbers) -> None:
    frame = results({"fault_type": "zeta"}, HIT, {}, {"fault_type": "jamming", "t_activation": 3})
    sheet = coverage_sheet("guided", tally_by_fault_type(frame), paper.as_published_counts())
    kinds = [line[0] for line in sheet.lines]
    assert kinds == [k for k in ("radar/chaff", "radar/jamming", "radar/zeta", "total") for _ in range(2)]
    chaff = sheet.table().rows[1]
    assert [cell.split(";")[0] for cell in chaff[2:]] == ["50.0 % (1/2", "100.0 % (1/1", "50.0 % (1/2"]


def test_the_csv_has_a_column_for_each_number(paper: PublishedNumbers) -> None:
    sheet = coverage_sheet("guided", tally_by_fault_type(results(HIT)), paper.as_published_counts())
    lines = list(csv.DictReader(io.StringIO(sheet.as_csv())))
    assert lines[0]["hazards/activated: count"] == "154"
    assert lines[0]["hazards/activated: of"] == "432"
    assert float(lines[0]["hazards/activated: rate"]) == pytest.approx(154 / 432, abs=1e-6)
    assert "| radar/chaff | paper |" in sheet.as_markdown()


def test_contradictory_counts_are_reported_with_their_line(tmp_path: Path) -> None:
    for file in REFERENCES.glob("paper_*.yaml"):
        (tmp_path / file.name).write_text(
            file.read_text().replace("guided_hazards: 154", "guided_hazards: 433")
        )
    with pytest.raises(MutatorError, match=r"paper_coverage\.yaml:6: counts that contradict"):
        load_published_numbers(tmp_path)


def test_within_fault_types_guided_faults_are_ahead_only_per_activated_fault(paper: PublishedNumbers) -> None:
    activated, injected = (
        guided_against_random.pool_odds_ratios(
            guided_against_random.strata_with_both_methods(paper.tally_by_fault_type, whole)
        )
        for whole in guided_against_random.RATE_BASES
    )
    assert activated.stratum_count == injected.stratum_count == 17
    assert injected.high < 1
    assert injected.p_of_odds_ratio_1 < 1e-6
    assert activated.low > 1


def test_the_papers_counts_and_ours_get_the_same_statistical_tests(paper: PublishedNumbers) -> None:
    frame = results(HIT, HIT | {"method": "random", "trigger": "random/C2"})
    overall, kinds = (
        hazard_odds_sheet(frame, paper.as_published_counts()),
        hazards_by_fault_type_sheet(frame, paper.as_published_counts()),
    )
    assert [line[:2] for line in overall.lines] == [
        (whole, source) for whole in ("activated", "injected") for source in ("paper", "here")
    ]
    assert str(overall.lines[0][2]).startswith("35.8 % (1316/3678")
    assert len(kinds.lines) == 2 * (17 + 1)
    assert all(line[-1] >= line[-2] for line in kinds.lines)  # type: ignore[operator]
