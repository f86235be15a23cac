"""Family files: what they mean, and what is refused with its line."""

from pathlib import Path
from typing import Any

import pytest

from mutator.errors import MutatorError
from mutator.families.family import Family, argument_of
from mutator.families.family_yaml import load_family

TEXT = """\
schema: family/1
name: stop
title: The lead brakes
source: A test
parameters:
  ego_kph: {from: 20, to: 60, step: 20}
  gap_m: [10, 12.5]
  road: [dry, wet]
constraints:
  - gap_m >= ego_mps
template: |
  speed: {{ ego_mps }}
  kph: {{ ego_kph }}
  gap: {{ gap_m + 1 }}
  road: {{ road }}
  title: {{ label }}
"""


def family_of(folder: Path, *changes: tuple[str, str]) -> Family:
    text = TEXT
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    (folder / "stop.yaml").write_text(text)
    return load_family(folder / "stop.yaml")


def test_a_template_has_each_value_in_all_units_of_its_dimension(tmp_path: Path) -> None:
    scenario = family_of(tmp_path).concrete([20, 12.5, "wet"])
    assert scenario.text.splitlines() == [
        "speed: 5.555555556",
        "kph: 20",
        "gap: 13.5",
        "road: wet",
        "title: ego 20 km/h, gap 12.5 m, road wet",
    ]
    assert scenario.name == f"stop-{scenario.digest[:12]}"
    assert dict(scenario.values) == {"ego_kph": 20, "gap_m": 12.5, "road": "wet"}


def test_steps_are_calculated_in_decimals(tmp_path: Path) -> None:
    changed = family_of(tmp_path, ("{from: 20, to: 60, step: 20}", "{from: 0.1, to: 0.7, step: 0.1}"))
    assert list(changed.parameters[0].values) == [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7]


def test_a_scenario_is_named_by_its_values_with_or_without_units(tmp_path: Path) -> None:
    family = family_of(tmp_path)
    scenario = family.concrete_from_text("ego=20, gap_m=12.5,road=wet")
    assert scenario == family.concrete([20, 12.5, "wet"])
    assert family.concrete_from_text(argument_of(scenario).removeprefix("stop:")) == scenario
    assert family.concrete_from_text("ego=30,gap=10,road=dry").values["ego_kph"] == 30  # between two steps


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("ego=20,gap=10", "no value of road"),
        ("egg=20", "'egg=20'.*did you mean 'ego'"),
        ("ego", "'ego'"),
        ("ego=20,ego_kph=20", "one value of ego"),
        ("ego=70,gap=10,road=dry", "ego=70"),
        ("ego=nan,gap=10,road=dry", "ego=nan"),
        ("ego=20,gap=10,road=icy", "road=icy"),
        ("ego=60,gap=10,road=dry", "gap_m >= ego_mps"),
    ],
)
def test_values_that_the_family_does_not_have_are_refused(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(MutatorError, match=message) as refusal:
        family_of(tmp_path).concrete_from_text(text)
    assert refusal.value.argument == "scenario"


@pytest.mark.parametrize(
    ("old", "new", "line", "message"),
    [
        ("name: stop", "name: go", 2, "'go'"),
        ("to: 60, step: 20", "to: 65, step: 20", 6, "a whole number of steps"),
        ("to: 60, step: 20", "to: 60, step: 0.0001", 6, "at most 100000 values"),
        ("to: 60, step: 20", "to: 60, step: 20, normal: {mean: 900, sd: 1}", 6, "a millionth"),
        ("[10, 12.5]", "[10, 10]", 7, "10 is listed twice"),
        ("[10, 12.5]", "[]", 7, "no value"),
        ("[dry, wet]", "[dry, 'wet: {']", 8, "letters, digits"),
        ("road: [dry", "t: [dry", 8, "'t'"),
        ("road: [dry", "gap: [dry", 8, "has the name `gap`"),
        ("ego_mps\n", "ego_mph + road\n", 10, "unknown name 'road'"),
        ("{{ road }}", "{{ rood }}", 11, "'rood' is undefined"),
        ("{{ road }}", "{{ road", 16, "the template"),
        ("{{ road }}", "{{ road * 999 }}", 11, "not allowed"),
        ("{{ road }}", "{{ self.x() }}", 15, "a call"),
        ("template:", "sampling: dice\ntemplate:", 11, "'dice'"),
        (
            "template:",
            "frequency: {source: x, of: {gap_m: [{from: 0, to: 11, weight: 1}]}}\ntemplate:",
            11,
            "0 parts with gap 12.5 m",
        ),
    ],
)
def test_a_mistake_is_refused_with_its_line(
    tmp_path: Path, old: str, new: str, line: int, message: str
) -> None:
    with pytest.raises(MutatorError) as refusal:
        family_of(tmp_path, (old, new))
    text = str(refusal.value)
    assert message in text
    assert refusal.value.line == line, text


def test_a_frequency_weighs_the_values_of_each_part(tmp_path: Path) -> None:
    parts = "[{from: 10, to: 30, weight: 3}, {from: 30, to: 60, weight: 1}]"
    family = family_of(
        tmp_path, ("template:", f"frequency: {{source: x, of: {{ego_kph: {parts}}}}}\ntemplate:")
    )
    assert family.frequency is not None
    assert family.frequency.probabilities == {"ego": (0.75, 0.125, 0.125)}


def test_a_distribution_says_how_likely_each_value_is(tmp_path: Path) -> None:
    changes: list[Any] = [("to: 60, step: 20", "to: 60, step: 20, normal: {mean: 40, sd: 10}")]
    ego = family_of(tmp_path, *changes).parameters[0]
    shares = [ego.probability(i) for i in range(3)]
    assert sum(shares) == pytest.approx(1)
    assert shares[0] == pytest.approx(shares[2])
    assert shares[1] == pytest.approx(0.6845, abs=1e-3)  # P(|z| < 1) / P(|z| < 3)
    assert [ego.index_at(quantile) for quantile in (0, 0.1, 0.2, 0.5, 0.9, 0.999)] == [0, 0, 1, 1, 2, 2]
