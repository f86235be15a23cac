"""Classes of hazards that are no contact, by rules of a scale."""

import re
from pathlib import Path

import pytest

from mutator.errors import MutatorError
from mutator.targets.hazard_severity import ClassifiedHazard
from mutator.targets.severity_yaml import load_severity_scale
from mutator.workspace import Workspace

from .test_hazard_severity import SCALE

RULE = """\
rules:
  leaves:
    about: x
    judgement: y
    values: {way: m, speed: m/s}
    classes:
      S0: {about: a}
      S1: {from: {way: 1}, about: b}
      S3: {from: {way: 1, speed: 2}, about: c}
"""


@pytest.mark.parametrize(
    ("hazard", "metrics", "severity"),
    [
        ("H3", {"lane_excursion": 52.0, "departure_speed": 1.5}, "S3"),
        ("H3", {"lane_excursion": 52.0, "departure_speed": 0.4}, "S2"),
        ("H3", {"lane_excursion": 0.2, "departure_speed": 1.5}, "S0"),
        ("H2", {"lost_speed": 26.7, "peak_deceleration": 2.8}, "S2"),
        ("H2", {"lost_speed": 26.7, "peak_deceleration": 7.0}, "S3"),
        ("H2", {"lost_speed": 1.0, "peak_deceleration": 7.0}, "S0"),
        ("H3", {"lane_excursion": 52.0}, None),  # without one of its values, a hazard has no class
    ],
)
def test_the_shipped_rules_classify_hazards_without_contact(
    hazard: str, metrics: dict[str, float], severity: str | None
) -> None:
    """Each hazard of the shipped target has a class; all bounds of a class must be reached."""
    workspace = Workspace.find()
    scale = workspace.scale_of(workspace.manifest("openpilot"))
    assert scale is not None
    expected = ClassifiedHazard(hazard, severity) if severity else None
    assert scale.worst_hazard([(hazard, 3.0)], metrics, None) == expected
    assert scale.worst_hazard([(hazard, 3.0)], metrics, 2.0) is None  # the drive had ended


def test_the_highest_class_of_a_run_counts() -> None:
    workspace = Workspace.find()
    scale = workspace.scale_of(workspace.manifest("openpilot"))
    assert scale is not None
    hazards = [("H3", 3.0), ("H1", 5.0)]
    left = {"lane_excursion": 1.0, "departure_speed": 1.0}
    assert scale.worst_hazard(hazards, left | {"delta_v": 2.0}, 5.0) == ("H3", "S3")
    assert scale.worst_hazard(hazards, left | {"delta_v": 12.0}, 5.0) == ("H3", "S3")  # the first
    assert scale.worst_hazard(hazards, {"delta_v": 12.0}, 5.0) == ("H1", "S3")
    fewer = scale.with_only_rules_of_metrics(["lost_speed", "peak_deceleration", "lane_excursion"])
    assert [rule.hazard for rule in fewer.rules] == ["H2"]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("    judgement: y\n", "", "rule 'leaves' without a source"),
        ("S0: {about: a}", "S2: {about: a}", "the classes S2, S1, S3; expected S0 and some of"),
        ("speed: 2}", "sped: 2}", "expected bounds of way, speed"),
        ("way: 1, speed: 2", "speed: 2", "none lower than in the one before"),
    ],
)
def test_mistakes_in_a_rule_are_reported(tmp_path: Path, old: str, new: str, message: str) -> None:
    path = tmp_path / "hard.yaml"
    path.write_text(SCALE + RULE)
    assert load_severity_scale(path).rules[0].classes[2] == ("S3", (1.0, 2.0), "c")
    assert old in RULE
    path.write_text(SCALE + RULE.replace(old, new))
    with pytest.raises(MutatorError, match=re.escape(message)):
        load_severity_scale(path)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("    H3: {rule:", "    H1: {rule:", "'H1'; expected a hazard other than `contact`: H2, H3"),
        ("excursion: lane_excursion", "excursion: lane_excursions", "'lane_excursions'; expected a metric"),
        ("excursion: lane_excursion", "excursion: peak_jerk", "excursion in m/s^3"),
        ("rule: hit_from_behind", "rule: hit", "'hit'; expected a rule of the scale collision"),
        ("  contact: H1\n", "", "`severity` with contact_speed, mass_kg, other_mass_kg; expected all of"),
        ("    hazard: H3\n", "", "`at_hazard` without `hazard`"),
        ("    hazard: H3\n", "    hazard: H9\n", "`at_hazard` with the hazard 'H9'"),
    ],
)
def test_mistakes_in_the_rules_of_a_manifest_are_reported(
    tmp_path: Path, old: str, new: str, message: str
) -> None:
    workspace = Workspace.find()
    text = workspace.targets["openpilot"].read_text()
    text = text.replace("../../target", str(workspace.library.parent / "target"))
    assert old in text
    (tmp_path / "openpilot.yaml").write_text(text.replace(old, new, 1))
    with pytest.raises(MutatorError, match=re.escape(message)):
        workspace.scale_of(workspace.manifest(str(tmp_path / "openpilot.yaml")))
