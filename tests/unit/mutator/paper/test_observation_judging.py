"""The published observations: their queries on the published counts, and each verdict of each rule."""

import math
from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from mutator.errors import MutatorError
from mutator.paper import observation_judging, observations_markdown_and_table
from mutator.paper.measures import Estimate, estimate_of_difference, estimate_of_share, median_time
from mutator.paper.observation_judging import (
    ClaimRule,
    ClaimVerdict,
    JudgedClaim,
    JudgedObservation,
    combined_verdict,
    judge_observations,
)
from mutator.paper.published_numbers import load_published_numbers
from mutator.statistics.shares_with_intervals import share_with_interval
from mutator.statistics.tallies import Tally

from ..statistics.results_frame import results

REFERENCES = Path(__file__).parents[4] / "fault_library" / "references"
FILE = REFERENCES / observation_judging.FILE_NAME
HOLDS, FAILS, UNDECIDED = ClaimVerdict
ACTIVATED = {"t_activation": 1.0}
EVENTS = {  # the events of a run, by the count that includes it
    "manifested": {"t_manifest": 2.0},
    "alerts": {"alerts": "steer_saturated", "t_alert": 3.0},
    "hazards": {"h3": 1, "t_h3": 9.0},
}


def runs_of(tally: Tally, **group: str) -> pd.DataFrame:
    """Return runs with the given counts of events."""
    warned = tally.hazards - (tally.hazards_no_alerts or 0)
    kinds = [
        (warned, ("manifested", "alerts", "hazards")),
        (tally.hazards_no_alerts or 0, ("manifested", "hazards")),
        (tally.alerts_no_hazards or 0, ("manifested", "alerts")),
    ]
    kinds.append(((tally.manifested or tally.activated) - sum(n for n, _ in kinds), ("manifested",)))
    kinds.append((tally.activated - sum(n for n, _ in kinds), ()))
    lines = [(n, group | ACTIVATED | {k: v for e in what for k, v in EVENTS[e].items()}) for n, what in kinds]
    lines.append((tally.injected - tally.activated, group))
    one_each = results(*(line for _, line in lines))
    return one_each.loc[one_each.index.repeat([n for n, _ in lines])]


def frame_of(parts: Iterable[pd.DataFrame]) -> pd.DataFrame:
    """Return a frame of these runs, with ids, pairs of methods, 40 faults and end times."""
    frame = pd.concat(parts, ignore_index=True)
    number = frame.groupby("method").cumcount()
    ids = {"experiment_id": frame.index.astype(str), "seed": number.astype(str)}
    return frame.assign(**ids, fault_id=(number % 40).astype(str), t_end=30.0)


def of_rows(*rows: dict[str, Any]) -> pd.DataFrame:
    """Return a frame of guided chaff runs in S1, each given by its differences from a run without
    activation."""
    return frame_of([results(*rows)])


@pytest.fixture(scope="module")
def table_2() -> dict[str, JudgedClaim]:
    """The claims, evaluated on runs with the counts of table II of the paper."""
    counts = load_published_numbers(REFERENCES).tally_by_scenario
    frame = frame_of(runs_of(t, method=method, scenario=s) for (method, s), t in counts.items())
    return {one.number: one for each in judge_observations(FILE, frame, []) for one in each.claims}


@pytest.fixture(scope="module")
def table_3() -> dict[str, JudgedClaim]:
    """The claims, evaluated on runs with the counts of table III of the paper."""
    parts = []
    for (method, kind), tally in load_published_numbers(REFERENCES).tally_by_fault_type.items():
        module, _, fault_type = kind.partition("/")
        tally = Tally(**asdict(tally) | {"manifested": tally.activated, "alerts_no_hazards": 0})
        parts.append(runs_of(tally, method=method, module=module, fault_type=fault_type))
    return {one.number: one for each in judge_observations(FILE, frame_of(parts), []) for one in each.claims}


@pytest.mark.parametrize("number", ["1.1", "1.2", "2.4", "3.4", "4.1", "4.2", "4.3"])
def test_a_query_finds_the_published_counts_of_table_2(table_2: dict[str, JudgedClaim], number: str) -> None:
    one = table_2[number]
    [answer] = one.answers
    published = one.claim.published_estimate()
    assert published is not None
    assert answer.estimate.text == published.text
    assert answer.verdict == one.verdict_on_paper


@pytest.mark.parametrize("number", ["2.1", "2.2", "2.7", "4.1"])
def test_a_query_finds_the_published_counts_of_table_3(table_3: dict[str, JudgedClaim], number: str) -> None:
    one = table_3[number]
    published = one.claim.published_estimate()
    assert published is not None
    assert one.answers[0].estimate.text == published.text


def test_guided_faults_are_ahead_only_per_activated_fault(table_3: dict[str, JudgedClaim]) -> None:
    assert table_3["4.4"].verdict is HOLDS
    assert table_3["4.5"].verdict is FAILS
    assert table_3["4.5"].verdict_on_paper is FAILS
    assert table_3["4.7"].verdict is FAILS
    effects = {answer.group: answer.verdict for answer in table_3["2.8"].answers}
    assert effects == dict.fromkeys(("rain", "snow", "occlusion", "contrast"), HOLDS)


def test_a_claim_that_allows_no_exception_names_none() -> None:
    """The rule `never` fails with the first run that has the property, whatever share the sentence allows."""
    claims = [claim.claim for one in judge_observations(FILE, of_rows({}), []) for claim in one.claims]
    strict = [claim.claim_text for claim in claims if claim.claim_rule and claim.claim_rule.never]
    assert strict
    assert not [text for text in strict if "less than" in text or "twenty" in text or "%" in text]


def test_claims_about_a_driver_use_the_cited_reaction_time() -> None:
    driver_s = load_published_numbers(REFERENCES).driver_reaction_s
    claims = [claim for one in judge_observations(FILE, of_rows({}), []) for claim in one.claims]
    asked = [one.claim for one in claims if one.claim.measure in ("mean_time", "median_time")]
    assert [claim.claim_rule.above for claim in asked if claim.claim_rule] == [driver_s, driver_s]
    assert any(f"> {driver_s:g} " in (one.claim.part or "") for one in claims)


@pytest.mark.parametrize(
    ("rule", "found", "verdict"),
    [
        (ClaimRule(above=0.5), estimate_of_share(share_with_interval(60, 100)), HOLDS),
        (ClaimRule(above=0.5), estimate_of_share(share_with_interval(40, 100)), FAILS),
        (ClaimRule(above=0.5), estimate_of_share(share_with_interval(52, 100)), UNDECIDED),
        (
            ClaimRule(above=0.5),
            estimate_of_share(share_with_interval(9, 9)),
            UNDECIDED,
        ),  # few runs, so undecided for any interval
        (ClaimRule(below=0.05), estimate_of_share(share_with_interval(0, 100)), HOLDS),
        (ClaimRule(below=0.05), estimate_of_share(share_with_interval(20, 100)), FAILS),
        (ClaimRule(below=0.05), estimate_of_share(share_with_interval(0, 0)), UNDECIDED),
        (
            ClaimRule(within=0.1),
            estimate_of_difference(share_with_interval(500, 1000), share_with_interval(510, 1000)),
            HOLDS,
        ),
        (
            ClaimRule(within=0.1),
            estimate_of_difference(share_with_interval(500, 1000), share_with_interval(900, 1000)),
            FAILS,
        ),
        (
            ClaimRule(within=0.1),
            estimate_of_difference(share_with_interval(5, 10), share_with_interval(5, 10)),
            UNDECIDED,
        ),
        (ClaimRule(some=0.05), estimate_of_share(share_with_interval(1, 2)), HOLDS),
        (ClaimRule(some=0.05), estimate_of_share(share_with_interval(0, 100)), FAILS),
        (ClaimRule(some=0.05), estimate_of_share(share_with_interval(0, 20)), UNDECIDED),
        (ClaimRule(never=0.05), estimate_of_share(share_with_interval(0, 100)), HOLDS),
        (ClaimRule(never=0.05), estimate_of_share(share_with_interval(1, 1000)), FAILS),
        (ClaimRule(never=0.05), estimate_of_share(share_with_interval(0, 0)), UNDECIDED),
    ],
)
def test_each_rule_reaches_each_verdict(rule: ClaimRule, found: Estimate, verdict: ClaimVerdict) -> None:
    assert rule.verdict_on(found) is verdict


def test_an_observation_holds_if_all_its_claims_hold() -> None:
    assert combined_verdict([HOLDS, HOLDS]) is HOLDS
    assert combined_verdict([HOLDS, UNDECIDED]) is UNDECIDED
    assert combined_verdict([UNDECIDED, FAILS]) is FAILS
    assert combined_verdict([]) is UNDECIDED


def test_a_claim_about_all_faults_needs_the_papers_mixture(table_2: dict[str, JudgedClaim]) -> None:
    frame = of_rows(*[ACTIVATED] * 200, *[ACTIVATED | {"t_h1": 9.0, "t_h3": 8.0}] * 20)
    first = judge_observations(FILE, frame, ["a type is missing", "5 are left"])[0].claims
    assert table_2["1.1"].verdict is HOLDS
    assert (first[0].answers[0].verdict, first[0].verdict) == (HOLDS, UNDECIDED)
    assert first[0].reason == "a type is missing; 5 are left"
    assert first[3].verdict is HOLDS


def test_a_claim_is_undecided_if_a_group_is_missing() -> None:
    frame = of_rows(ACTIVATED | {"scenario": "S2", "alerts": "fcw", "t_alert": 2.0})
    fcw = judge_observations(FILE, frame, [])[0].claims[4]
    assert [answer.verdict for answer in fcw.answers] == [HOLDS, UNDECIDED, UNDECIDED]
    assert fcw.verdict is UNDECIDED


def test_the_median_time_to_a_hazard_includes_runs_without_one() -> None:
    alerted = ACTIVATED | {"alerts": "fcw", "t_alert": 2.0}
    safe, late = of_rows(*[alerted] * 20), of_rows(*[alerted | {"t_h1": 6.0}] * 20)
    assert median_time(safe, of="").low == math.inf
    found = median_time(late, of="")
    assert (found.value, found.low, found.high) == (4.0, 4.0, 4.0)
    few = median_time(late[:5], of="")
    assert few.value == 4.0 and math.isnan(few.low) and math.isnan(few.high)
    assert math.isnan(median_time(safe.assign(t_end=math.nan), of="").low)


def test_a_query_that_fails_is_reported_with_its_line(tmp_path: Path) -> None:
    file = tmp_path / "o.yaml"
    text = FILE.read_text()
    file.write_text(text.replace("part: not is_alert", "part: not is_allert", 1))
    line = text[: text.index("says: Most activated")].count("\n") + 1
    with pytest.raises(MutatorError, match="is_allert") as caught:
        judge_observations(file, of_rows({}), [])
    assert caught.value.line == line


@pytest.mark.parametrize(
    ("old", "new"),
    [("measure: share", "measure: chare"), ("holds: {above: 0.5}", "holds: {above: 0.5, below: 0.6}")],
)
def test_an_invalid_claim_is_reported_with_its_line(tmp_path: Path, old: str, new: str) -> None:
    file = tmp_path / "o.yaml"
    file.write_text(FILE.read_text().replace(old, new, 1))
    with pytest.raises(MutatorError) as caught:
        judge_observations(file, of_rows({}), [])
    assert caught.value.line


def test_the_query_in_the_report_gives_the_reported_numbers() -> None:
    frame = of_rows(*[ACTIVATED] * 3, ACTIVATED | {"alerts": "fcw", "t_alert": 2.0, "t_h1": 9.0})
    told: tuple[JudgedObservation, ...] = judge_observations(FILE, frame, [])
    names: dict[str, object] = {"runs": frame}
    exec("from mutator.paper.measures import *", names)
    answers = [answer for one in told for claim in one.claims for answer in claim.answers]
    assert len(answers) > 30
    assert [eval(answer.query, names).text for answer in answers] == [a.estimate.text for a in answers]
    assert all(
        a.query in observations_markdown_and_table.render_observations_markdown(told, (), "") for a in answers
    )
