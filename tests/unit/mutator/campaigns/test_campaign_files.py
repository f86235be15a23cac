"""Campaign files: which keys are read, and how mistakes are reported."""

import re
from pathlib import Path

import pytest

import mutator
from mutator.campaigns.campaign_files import check_readings, load_campaign, load_campaign_study
from mutator.campaigns.plan import build_plan
from mutator.checks.library_check import library_problems
from mutator.errors import MutatorError
from mutator.model import Method
from mutator.store.plan_choices import Choices
from mutator.workspace import Workspace

TEXT = """\
schema: campaign/1
name: mine
about: For tests.
target: toycar
scenarios: [A, B]
faults:
  - spec: sensor/*
  - {spec: sensor/lane/shifted, values: 2}
methods: [guided, random]
triggers:
  table: near_far
  armed_after_s: {as_described: 1.5, as_coded: 0.0}
  random_until_s: 5.0
seed: 3
canary: {spec: sensor/lane/shifted, scenario: A, hazard: H3, at_s: 1.0}
"""


def test_a_campaign_is_read(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text(TEXT)
    campaign = load_campaign(path)
    assert (campaign.name, campaign.target, campaign.seed) == ("mine", "toycar", 3)
    assert campaign.methods == (Method.GUIDED, Method.RANDOM)
    assert [selection.values_per_variant for selection in campaign.fault_selections] == [None, 2]
    assert campaign.armed_after_s_by_reading == {"as_described": 1.5, "as_coded": 0.0}
    assert (campaign.sample_size, campaign.context_ids, campaign.reading) == (None, None, None)
    assert campaign.limits.wall_s > campaign.limits.cpu_s
    assert campaign.file_bytes == TEXT.encode()


@pytest.mark.parametrize(
    ("old", "new", "line", "told"),
    [
        ("campaign/1", "campaign/2", 1, "newer version"),
        ("name: mine", "name: My Campaign", 2, "My Campaign"),
        ("[A, B]", "[A, B, A]", 5, "'A' is listed twice"),
        ("[A, B]", "[]", 5, "scenarios"),
        ("values: 2", "values: 0", 8, "values"),
        ("values: 2", "value: 2", 8, "unknown key 'value'"),
        ("[guided, random]", "[guided, guided]", 9, "listed twice"),
        ("[guided, random]", "[guided, chance]", 9, "chance"),
        ("random_until_s: 5.0", "random_until_s: 1.0", None, "later than `armed_after_s`"),
        ("random_until_s: 5.0", "random_until: 5.0", None, "random_until"),
        ("as_described: 1.5", "as_described: -1.5", 12, "-1.5"),
        ("seed: 3", "seed: three", 14, "three"),
        ("at_s: 1.0", "at_s: .nan", 15, "nan"),
        ("seed: 3", "seed: 3\nlimits: {cpu_s: 0}", 15, "cpu_s"),
        ("seed: 3", "seed: 3\nlimits: {disk_mb: 0}", 15, "disk_mb"),
        ("seed: 3", f"seed: 3\nlimits: {{wall_s: {10**299}}}", 15, "wall_s"),
        ("random_until_s: 5.0", "random_until_s: 1.0e+300", 13, "random_until_s"),
        ("random_until_s: 5.0", "random_until_s: .inf", 13, "random_until_s"),
        ("seed: 3", "seed: 3\nchunk: 0", 15, "chunk"),
        (
            "seed: 3",
            f"seed: 3\ndefences: [none, [{'d' * 110}, {'e' * 110}]]",
            15,
            "2 defences whose names have 221 bytes together; expected at most 220",
        ),
        ("seed: 3", "seed: 3\nseed: 4", 15, "duplicate key"),
    ],
)
def test_mistakes_are_reported_with_their_line(
    tmp_path: Path, old: str, new: str, line: int | None, told: str
) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text(TEXT.replace(old, new))
    with pytest.raises(MutatorError, match=re.escape(told)) as error:
        load_campaign(path)
    assert error.value.where == str(path)
    assert error.value.line is not None
    assert line is None or error.value.line == line


def test_every_shipped_campaign_loads(clone: Workspace) -> None:
    names = clone.campaigns
    assert "quickstart" in names
    for name in names:
        assert load_campaign(clone.campaign(name)).name == name


KNOWN = "reading 'as_built'; expected one of as_described, as_coded"


def in_library(toycar: Workspace, old: str, new: str) -> Path:
    path = toycar.library / "campaigns" / "mine.yaml"
    text = TEXT.replace(old, new)
    assert new in text
    path.write_text(text)
    return path


def test_a_single_arming_time_applies_to_every_reading(toycar: Workspace) -> None:
    path = in_library(toycar, "{as_described: 1.5, as_coded: 0.0}", "1.25")
    campaign = load_campaign(path)
    check_readings(campaign, toycar.readings())
    assert [campaign.armed_after_s_in(name) for name in toycar.readings().names] == [1.25, 1.25]


def test_a_setting_can_differ_by_reading(toycar: Workspace) -> None:
    for text, expected in (
        ("", {"as_described": (), "as_coded": ()}),
        ("setting: [alone]\n", {"as_described": ("alone",), "as_coded": ("alone",)}),
        ("setting: {as_described: [], as_coded: [alone]}\n", {"as_described": (), "as_coded": ("alone",)}),
    ):
        path = in_library(toycar, "methods:", f"{text}methods:")
        campaign = load_campaign(path)
        check_readings(campaign, toycar.readings())
        assert {name: campaign.changes_in(name) for name in expected} == expected
    for name in expected:
        made = build_plan(toycar, path, Choices(reading=name)).experiments
        assert {experiment.setting for experiment in made} == {expected[name]}
    twice = in_library(toycar, "methods:", "setting: {as_coded: [alone, alone]}\nmethods:")
    with pytest.raises(MutatorError, match=r"mine\.yaml:9: 'alone' is listed twice"):
        load_campaign(twice)


@pytest.mark.parametrize(
    ("old", "new", "line", "told"),
    [
        (
            "methods:",
            "reading: as_built\nmethods:",
            9,
            "reading 'as_built'; expected one of as_described, as_coded",
        ),
        ("as_coded: 0.0", "as_built: 0.0", 12, "reading 'as_built'; expected one of as_described, as_coded"),
        (", as_coded: 0.0", "", 12, "no time for reading 'as_coded'"),
        (
            "methods:",
            "setting: {as_described: [alone]}\nmethods:",
            9,
            "no setting for reading 'as_coded'",
        ),
    ],
)
def test_readings_must_be_those_of_the_library(
    toycar: Workspace, old: str, new: str, line: int, told: str
) -> None:
    path = in_library(toycar, old, new)
    with pytest.raises(MutatorError) as error:
        build_plan(toycar, path)
    assert f"{path}:{line}: {told}" in str(error.value)
    assert any(told in str(problem) for problem in library_problems(toycar, "toycar"))


def test_a_plan_looks_up_only_the_changes_of_its_reading(toycar: Workspace) -> None:
    text = "setting: {as_described: [], as_coded: [upside_down]}\nmethods:"
    path = in_library(toycar, "methods:", text)
    build_plan(toycar, path)
    with pytest.raises(MutatorError, match=r"mine\.yaml:9: change 'upside_down'"):
        build_plan(toycar, path, Choices(reading="as_coded"))


def test_an_unknown_study_is_refused_with_its_line(toycar: Workspace, tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text(TEXT)
    assert build_plan(toycar, path).campaign.study is None
    path.write_text(TEXT.replace("target: toycar", "target: toycar\nstudy: moon_landing"))
    said = "mine.yaml:5: no study 'moon_landing'; expected one of driving_agent_resilience"
    with pytest.raises(MutatorError, match=said):
        mutator.plan(path, workspace=toycar)
    with pytest.raises(MutatorError, match=said):
        load_campaign_study(load_campaign(path))
