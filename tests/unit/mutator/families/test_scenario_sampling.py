"""Scenarios drawn from a family: reproducible, different, within the constraints."""

from collections import Counter
from itertools import pairwise
from pathlib import Path

import pytest

from mutator.errors import MutatorError
from mutator.families.family import Family
from mutator.families.family_yaml import load_family
from mutator.families.scenario_sampling import SAMPLING_METHODS, frequency_weight, sample_scenarios

TEXT = """\
schema: family/1
name: stop
title: The lead brakes
source: A test
parameters:
  ego_kph: {from: 1, to: 100, step: 1}
  gap_m: {from: 1, to: 100, step: 1}
constraints: [gap_m > ego_kph]
template: "{{ ego_kph }} {{ gap_m }}"
"""
DRAWN = [method for method in SAMPLING_METHODS if method != "grid"]


@pytest.fixture
def family(tmp_path: Path) -> Family:
    (tmp_path / "stop.yaml").write_text(TEXT)
    return load_family(tmp_path / "stop.yaml")


@pytest.mark.parametrize("method", DRAWN)
def test_a_weight_relates_occurrence_to_the_draw(tmp_path: Path, method: str) -> None:
    """Values that occur as often as they are drawn have weight 1; a grid draws all values equally often."""
    speeds = "{from: 1, to: 100, step: 1, normal: {mean: 50, sd: 20}}"
    parts = "{from: 1, to: 51, weight: 3}, {from: 51, to: 100, weight: 1}"
    text = TEXT.replace("{from: 1, to: 100, step: 1}", speeds, 1)
    text += f"frequency: {{source: A count, of: {{gap_m: [{parts}]}}}}\n"
    (tmp_path / "stop.yaml").write_text(text)
    family = load_family(tmp_path / "stop.yaml")
    for values, expected in (((50, 1), 1.5), ((1, 50), 1.5), ((50, 100), 0.5)):
        weight = frequency_weight(family, dict(zip(("ego_kph", "gap_m"), values, strict=True)), method)
        assert weight == pytest.approx(expected)
    by_speed = text.replace("of: {gap_m", "of: {ego_kph")
    (tmp_path / "stop.yaml").write_text(by_speed)
    family = load_family(tmp_path / "stop.yaml")
    slow, middle = ({"ego_kph": kph, "gap_m": 9} for kph in (1, 50))
    assert frequency_weight(family, slow, method) > frequency_weight(family, middle, method)
    assert frequency_weight(family, slow, "grid") == frequency_weight(family, middle, "grid")


@pytest.mark.parametrize("method", SAMPLING_METHODS)
def test_scenarios_differ_meet_the_constraints_and_can_be_drawn_again(family: Family, method: str) -> None:
    scenarios = sample_scenarios(family, 200, method, seed=3)
    assert len({scenario.name for scenario in scenarios}) == 200
    assert all(scenario.values["gap_m"] > scenario.values["ego_kph"] for scenario in scenarios)  # type: ignore[operator]
    assert sample_scenarios(family, 200, method, seed=3) == scenarios
    assert (sample_scenarios(family, 200, method, seed=4) == scenarios) is (method == "grid")


@pytest.mark.parametrize("method", ["random", "sobol"])
def test_a_larger_sample_begins_with_the_smaller_one(family: Family, method: str) -> None:
    assert sample_scenarios(family, 300, method, 0)[:100] == sample_scenarios(family, 100, method, 0)


def test_a_grid_has_all_combinations_or_an_even_part(family: Family) -> None:
    grid = sample_scenarios(family, None, "grid", 0)
    assert len(grid) == 99 * 100 // 2
    names = [scenario.name for scenario in grid]
    places = [names.index(scenario.name) for scenario in sample_scenarios(family, 10, "grid", 0)]
    assert {after - before for before, after in pairwise(places)} == {495}


def test_a_latin_hypercube_uses_each_part_of_each_range_once(tmp_path: Path) -> None:
    (tmp_path / "stop.yaml").write_text(TEXT.replace("constraints: [gap_m > ego_kph]\n", ""))
    scenarios = sample_scenarios(load_family(tmp_path / "stop.yaml"), 50, "latin_hypercube", 0)
    for key in ("ego_kph", "gap_m"):
        parts = Counter((int(scenario.values[key]) - 1) // 2 for scenario in scenarios)
        assert parts == Counter(range(50))


def test_sobol_covers_a_plane_more_evenly_than_chance(tmp_path: Path) -> None:
    (tmp_path / "stop.yaml").write_text(TEXT.replace("constraints: [gap_m > ego_kph]\n", ""))
    family = load_family(tmp_path / "stop.yaml")

    def empty_cells(method: str) -> int:
        scenarios = sample_scenarios(family, 128, method, 0)
        cells = {(int(s.values["ego_kph"]) // 13, int(s.values["gap_m"]) // 13) for s in scenarios}
        return 64 - len(cells)

    assert empty_cells("sobol") < empty_cells("random")


@pytest.mark.parametrize("method", SAMPLING_METHODS)
def test_more_scenarios_than_there_are_is_refused(tmp_path: Path, method: str) -> None:
    (tmp_path / "stop.yaml").write_text(TEXT.replace("to: 100,", "to: 10,"))
    with pytest.raises(MutatorError, match=r"only \d+ scenarios that differ and meet its constraints"):
        sample_scenarios(load_family(tmp_path / "stop.yaml"), 60, method, 0)


@pytest.mark.parametrize("method", DRAWN)
def test_only_a_grid_needs_no_number(family: Family, method: str) -> None:
    with pytest.raises(MutatorError, match="without a `sample`"):
        sample_scenarios(family, None, method, 0)


def test_a_grid_that_nobody_can_wait_for_is_refused(tmp_path: Path) -> None:
    (tmp_path / "stop.yaml").write_text(TEXT.replace("to: 100, step: 1}", "to: 100, step: 0.01}"))
    with pytest.raises(MutatorError, match="a grid of 98029801 scenarios"):
        sample_scenarios(load_family(tmp_path / "stop.yaml"), None, "grid", 0)


def test_scenarios_with_the_same_text_are_refused(tmp_path: Path) -> None:
    (tmp_path / "stop.yaml").write_text(TEXT.replace(" {{ gap_m }}", ""))
    with pytest.raises(MutatorError, match="are both stop-"):
        sample_scenarios(load_family(tmp_path / "stop.yaml"), 2000, "grid", 0)
