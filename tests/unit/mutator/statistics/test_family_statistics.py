"""Results by concrete scenario, and shares over a family with intervals over scenarios."""

import math

import numpy as np
import pandas as pd
import pytest

from mutator.families.family_facts import FamilyFacts, ParameterFacts
from mutator.model import ConcreteScenario
from mutator.statistics import family_statistics
from mutator.statistics.family_statistics import families_sheet, family_shares, scenarios_frame
from mutator.statistics.fault_free_drive_tables import JudgedDrive
from mutator.store.golden_runs import GoldenRun
from mutator.store.golden_verdicts import GoldenVerdict

FACTS = FamilyFacts(
    name="follow",
    title="",
    parameters=(ParameterFacts(key="ego_kph", name="ego", unit="km/h", is_text=False),),
)
SCENARIOS = [
    ConcreteScenario(family="follow", values={"ego_kph": kph}, label=f"ego {kph} km/h", text=str(kph))
    for kph in (40, 50, 60, 70)
]


def usable(outcomes_by_scenario: dict[str, list[str]]) -> pd.DataFrame:
    rows = [(name, outcome) for name, outcomes in outcomes_by_scenario.items() for outcome in outcomes]
    frame = pd.DataFrame(rows, columns=["scenario", "outcome"])
    frame["t_near"] = np.where(frame["outcome"] == "hazard", 2.0, math.nan)
    frame.attrs["hazards"] = ("NEAR",)
    return frame


def golden(scenario: str, hazards: tuple[str, ...], margin: float, *changes: str) -> JudgedDrive:
    verdict = GoldenVerdict(
        duration_s=30.0,
        t_end=None,
        hazards=tuple((name, 1.0) for name in hazards),
        alerts=(),
        metrics=(("margin_near", margin),),
    )
    return JudgedDrive(golden_run=GoldenRun(scenario, changes), concrete=None, verdict=verdict)


def test_each_concrete_scenario_is_a_row_with_values_golden_run_and_counts() -> None:
    """A scenario without experiments or golden run is there too; hazards are those of any golden run."""
    first, second, *_ = (scenario.name for scenario in SCENARIOS)
    runs = [golden(first, ("NEAR",), -1.0, "alone"), golden(first, (), 3.0), golden("S1", (), 0.0)]
    frame = scenarios_frame([FACTS], SCENARIOS, usable({first: ["hazard", "sdc"], second: [""]}), runs)
    assert frame["ego_kph"].tolist() == [40, 50, 60, 70]
    assert frame["golden_hazards"].dropna().to_dict() == {first: "NEAR"}
    assert frame.loc[first, "golden_margin_near"] == 3.0
    columns = ["experiments", "hazard", "sdc", "failed", "near"]
    assert frame[columns].to_numpy().tolist() == [[2, 1, 1, 0, 1], [1, 0, 0, 1, 0], [0] * 5, [0] * 5]


def shares_of(counts: list[tuple[int, int]], weights: np.ndarray | None = None) -> dict[str, object]:
    """The shares of scenarios with so many hazards, of so many experiments."""
    outcomes = {
        scenario.name: ["hazard"] * hazards + ["masked"] * (count - hazards)
        for scenario, (hazards, count) in zip(SCENARIOS, counts, strict=True)
    }
    frame = scenarios_frame([FACTS], SCENARIOS, usable(outcomes))
    return {share.what: share for share in family_shares(frame, ["NEAR"], weights)}


@pytest.fixture
def four_are_enough(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(family_statistics, "_LEAST_SCENARIOS", 4)


def test_there_is_no_interval_for_few_scenarios() -> None:
    """The bootstrap of a handful of scenarios covers too little."""
    assert math.isnan(shares_of([(1, 1), (0, 1), (0, 1), (0, 1)])["hazard"].share.low)


@pytest.mark.usefixtures("four_are_enough")
def test_the_interval_is_that_of_scenarios_not_of_experiments() -> None:
    """A hundred like experiments of a scenario say no more than one of them."""
    few = shares_of([(1, 1), (0, 1), (0, 1), (0, 1)])["hazard"].share
    many = shares_of([(100, 100), (0, 100), (0, 100), (0, 100)])["hazard"].share
    assert (few.rate, few.low, few.high) == (many.rate, many.low, many.high)
    assert few.low == 0.0
    assert few.high == pytest.approx(0.75)


@pytest.mark.usefixtures("four_are_enough")
def test_there_is_no_interval_if_all_scenarios_agree() -> None:
    share = shares_of([(1, 2)] * 4)["hazard"].share
    assert share.rate == 0.5
    assert math.isnan(share.low)


@pytest.mark.usefixtures("four_are_enough")
def test_a_weight_counts_a_scenario_that_often() -> None:
    weights = np.array([3.0, 1.0, 1.0, 1.0])
    weighted = shares_of([(2, 2), (0, 2), (0, 2), (0, 2)], weights)["hazard"].weighted
    assert weighted.rate == pytest.approx(0.5)
    assert weighted.low <= 0.5 <= weighted.high
    assert str(weighted).startswith("50.0 % (")


def test_a_scenario_without_experiments_does_not_count() -> None:
    share = shares_of([(1, 1), (0, 1), (0, 0), (0, 0)])["hazard"].share
    assert (share.count, share.of) == (1, 2)


def test_the_sheet_has_weighted_columns_only_with_weights() -> None:
    plain = list(shares_of([(1, 1), (0, 1), (0, 1), (0, 1)]).values())
    weighted = list(shares_of([(1, 1), (0, 1), (0, 1), (0, 1)], np.ones(4)).values())
    assert families_sheet({"follow": plain}).heads == ("family", "what", "share")
    sheet = families_sheet({"follow": weighted})
    assert sheet.heads[3:] == ("weighted", "weighted low", "weighted high")
    assert sheet.as_csv().splitlines()[1].startswith("follow,not activated,0,4,0")
