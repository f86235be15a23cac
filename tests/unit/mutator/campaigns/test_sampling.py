"""Samples are even and deterministic, and keep the plan's order."""

from collections import Counter
from collections.abc import Callable
from dataclasses import replace

import pytest

from mutator.campaigns.sampling import (
    draw_balanced,
    draw_balanced_pairs,
    draw_in_proportion,
    evenly_spread_indices,
)
from mutator.model import AfterHazard, ConcreteScenario, Experiment, Method

SPECS = ("radar/chaff/distance", "radar/jamming/no_data", "car/speed/slower")


@pytest.fixture
def many(experiment: Callable[..., Experiment]) -> list[Experiment]:
    made = []
    for spec, values in zip(SPECS, (10, 1, 3), strict=True):
        for scenario in ("S1", "S2"):
            for value in range(values):
                for trigger in ("C1", "C2"):
                    made.append(experiment(value, scenario, Method.GUIDED, trigger, spec))
                    made.append(experiment(value, scenario, Method.RANDOM, f"random/{trigger}", spec))
    return made


@pytest.mark.parametrize("count", [6, 12, 24])
def test_a_sample_is_balanced(many: list[Experiment], count: int) -> None:
    picked = draw_balanced(many, count, seed=1)
    assert len(picked) == count
    assert set(Counter(e.fault.spec for e in picked).values()) == {count // 3}
    assert set(Counter(e.method for e in picked).values()) == {count // 2}
    for counts in (Counter(e.scenario for e in picked), Counter(e.trigger.name for e in picked)):
        assert max(counts.values()) - min(counts.values()) <= 1


def test_if_a_variant_has_too_few_experiments_others_fill_its_share(many: list[Experiment]) -> None:
    picked = draw_balanced(many, 60, seed=1)
    counts = Counter(e.fault.spec for e in picked)
    assert counts["radar/jamming/no_data"] == 8
    assert len({e.id for e in picked}) == 60


def test_a_seed_always_picks_the_same_experiments(many: list[Experiment]) -> None:
    picked = draw_balanced(many, 10, seed=1)
    assert [many.index(e) for e in picked] == sorted(many.index(e) for e in picked)
    assert draw_balanced(list(reversed(many)), 10, seed=1) == tuple(reversed(picked))
    assert draw_balanced(many, 10, seed=2) != picked


@pytest.mark.parametrize("draw", [draw_balanced, draw_balanced_pairs])
def test_stopping_after_a_hazard_does_not_change_the_sample(
    many: list[Experiment], draw: Callable[..., tuple[Experiment, ...]]
) -> None:
    stopping = [replace(experiment, after_hazard=AfterHazard.STOP) for experiment in many]
    picked = [many.index(e) for e in draw(many, 11, seed=1)]
    assert [stopping.index(e) for e in draw(stopping, 11, seed=1)] == picked


def test_a_sample_as_large_as_the_plan_is_the_plan(many: list[Experiment]) -> None:
    assert draw_balanced(many, 1000, seed=1) == tuple(many)


@pytest.mark.parametrize(
    ("count", "wanted", "indices"),
    [(10, 1, [5]), (10, 2, [2, 7]), (3, 3, [0, 1, 2]), (2, 5, [0, 1]), (1, 1, [0])],
)
def test_values_are_spread_evenly_over_the_range(count: int, wanted: int, indices: list[int]) -> None:
    assert evenly_spread_indices(count, wanted) == indices


def test_a_proportional_sample_keeps_pairs_and_the_share_of_each_variant(many: list[Experiment]) -> None:
    picked = draw_in_proportion(many, 56, seed=1)
    assert len(picked) == len({e.id for e in picked}) == 56
    assert Counter(e.fault.spec for e in picked) == dict(zip(SPECS, (40, 4, 12), strict=True))
    keys = {m: {key(e) for e in picked if e.method is m} for m in Method}
    assert keys[Method.GUIDED] == keys[Method.RANDOM]
    assert draw_in_proportion(many, 56, seed=1) == picked
    assert draw_in_proportion(many, 56, seed=2) != picked


@pytest.mark.parametrize("count", [2, 12, 24, 40, 54])
def test_sampled_pairs_stay_together(many: list[Experiment], count: int) -> None:
    picked = draw_balanced_pairs(many, count, seed=1)
    assert len(picked) == count
    keys = {m: {key(e) for e in picked if e.method is m} for m in Method}
    assert keys[Method.GUIDED] == keys[Method.RANDOM] and len(keys[Method.GUIDED]) == count // 2
    if count in (12, 24):
        assert set(Counter(e.fault.spec for e in picked).values()) == {count // 3}
        for counts in (Counter(e.scenario for e in picked), Counter(key(e)[2] for e in picked)):
            assert max(counts.values()) - min(counts.values()) <= 2
    assert [many.index(e) for e in picked] == sorted(many.index(e) for e in picked)
    assert draw_balanced_pairs(list(reversed(many)), count, seed=1) == tuple(reversed(picked))


@pytest.mark.parametrize("count", [1, 11, 55])
def test_a_sample_of_odd_size_splits_one_pair(many: list[Experiment], count: int) -> None:
    picked = draw_balanced_pairs(many, count, seed=1)
    guided, random = ({key(e) for e in picked if e.method is m} for m in (Method.GUIDED, Method.RANDOM))
    assert len(picked) == count and len(guided - random) == 1 and random <= guided


def test_unpaired_experiments_are_sampled_one_by_one(many: list[Experiment]) -> None:
    guided = [e for e in many if e.method is Method.GUIDED]
    assert draw_balanced_pairs(guided, 9, seed=1) == draw_balanced(guided, 9, seed=1)


def key(experiment: Experiment) -> tuple[str, str, str]:
    return experiment.scenario, experiment.fault.id, experiment.trigger.name.removeprefix("random/")


@pytest.mark.parametrize("count", [10, 57])
def test_a_proportional_sample_of_an_unsuitable_size_is_refused(many: list[Experiment], count: int) -> None:
    """The size must be even, and at least two for each variant in each scenario."""
    with pytest.raises(ValueError, match="a multiple of 2, 12 or more"):
        draw_in_proportion(many, count, seed=1)


@pytest.fixture
def of_family(experiment: Callable[..., Experiment]) -> list[Experiment]:
    """Three faults in each of 40 scenarios of a family, and in S1."""
    scenarios = [
        ConcreteScenario(family="follow", values={"ego_kph": kph}, label=f"ego {kph} km/h", text=str(kph))
        for kph in range(40)
    ]
    made = [experiment(1, "S1", Method.RANDOM, "random/C1", spec) for spec in SPECS]
    return made + [
        replace(
            experiment(value, scenario.name, Method.RANDOM, "random/C1", spec),
            scenario_digest=scenario.digest,
            concrete=scenario,
        )
        for scenario in scenarios
        for spec in SPECS
        for value in (1, 2)
    ]


@pytest.mark.parametrize("draw", [draw_balanced, draw_balanced_pairs])
def test_the_scenarios_of_a_family_count_as_one_and_take_turns(
    of_family: list[Experiment], draw: Callable[..., tuple[Experiment, ...]]
) -> None:
    """S1 has as large a share as the family; no scenario of it has two of a variant before all have one."""
    picked = draw(of_family, 6, seed=1)
    assert Counter(e.family_or_scenario for e in picked) == {"S1": 3, "follow": 3}
    picked = draw(of_family, 3 + 3 * 40, seed=1)
    assert set(Counter((e.scenario, e.fault.spec) for e in picked).values()) == {1}


def test_a_sample_in_proportion_takes_families_as_a_whole(of_family: list[Experiment]) -> None:
    """Fewer experiments than scenarios can be drawn, and experiments of different scenarios are no pair."""
    picked = draw_in_proportion(of_family, 30, seed=1)
    assert Counter(e.family_or_scenario for e in picked)["S1"] == 3
    assert len({e.scenario for e in picked}) > 10
