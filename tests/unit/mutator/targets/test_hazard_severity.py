"""Severity in a manifest, and the scales in a library."""

import re
from pathlib import Path

import pytest

from mutator.errors import MutatorError
from mutator.targets.severity_yaml import load_severity_scale
from mutator.workspace import Workspace

KPH = 1 / 3.6
SCALE = """\
schema: severity/1
source: x
classes:
  S0: {from_kph: 0, about: a}
  S1: {from_kph: 4, about: b}
  S2: {from_kph: 20, about: c}
  S3: {from_kph: 40, about: d}
"""


@pytest.mark.parametrize(
    ("kph", "severity"),
    [(0, "S0"), (3.99, "S0"), (4, "S1"), (19.9, "S1"), (20, "S2"), (39.9, "S2"), (40, "S3"), (150, "S3")],
)
def test_the_shipped_scale_is_that_of_sae_j2980(kph: float, severity: str) -> None:
    """Contacts are classified by the strict limits of the ranges in SAE J2980."""
    workspace = Workspace.find()
    scale = workspace.scale_of(workspace.manifest("openpilot"))
    assert scale is not None
    assert scale.class_of_delta_v(kph * KPH) == severity


def test_a_class_is_shown_with_the_words_of_its_scale(tmp_path: Path) -> None:
    """A class alone could also be a scenario; its words are those of the library, or its `about`."""
    path = tmp_path / "hard.yaml"
    path.write_text(SCALE.replace("about: c", "words: hard, about: c"))
    words = {"S0": "a", "S1": "b", "S2": "hard", "S3": "d"}
    assert load_severity_scale(path).labels == {name: f"{of} (severity {name})" for name, of in words.items()}
    shipped = Workspace.find().scale_of(Workspace.find().manifest("openpilot"))
    assert shipped is not None
    assert list(shipped.labels.values()) == [
        "no injuries (severity S0)",
        "light (severity S1)",
        "severe (severity S2)",
        "possibly fatal (severity S3)",
    ]


def test_the_shipped_contact_is_with_an_equal_car() -> None:
    """The mass is that of the simulator's car, so delta-v is half the closing speed."""
    contact = Workspace.find().manifest("openpilot").contact
    assert contact is not None
    assert (contact.hazard, contact.mass_kg, contact.delta_v_mps(20.0)) == ("H1", 1461.6, 10.0)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "  S1: {from_kph: 4, about: b}\n",
            "",
            "3: the classes S0, S2, S3; expected S0, S1, S2, S3,",
        ),
        ("from_kph: 0", "from_kph: 1", "4: 1; expected 0 for S0"),
        ("from_kph: 20", "from_kph: 4", "6: 4; expected 0 for S0, and for each other class more than"),
        ("from_kph: 40", "from_mps: 11", "7: "),
    ],
)
def test_mistakes_in_a_scale_are_reported(tmp_path: Path, old: str, new: str, message: str) -> None:
    (tmp_path / "hard.yaml").write_text(SCALE)
    assert load_severity_scale(tmp_path / "hard.yaml").classes[2] == ("S2", 20 * KPH, "c")
    (tmp_path / "hard.yaml").write_text(SCALE.replace(old, new))
    with pytest.raises(MutatorError, match=re.escape(f"hard.yaml:{message}")):
        load_severity_scale(tmp_path / "hard.yaml")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("contact: H1", "contact: H3", "'H3'; expected a hazard with `terminal`: H1"),
        ("contact_speed: contact_speed", "contact_speed: smallest_gap", "unit m/s: contact_speed"),
        ("scale: collision", "scale: colision", "'colision'; expected one of collision, or a file in "),
        ("mass_kg: 1461.6", "mass_kg: 0", "0"),
    ],
)
def test_mistakes_in_a_manifests_severity_are_reported(
    tmp_path: Path, old: str, new: str, message: str
) -> None:
    workspace = Workspace.find()
    text = (
        workspace.targets["openpilot"]
        .read_text()
        .replace("../../target", str(workspace.library.parent / "target"))
    )
    assert old in text
    (tmp_path / "openpilot.yaml").write_text(text.replace(old, new, 1))
    with pytest.raises(MutatorError, match=re.escape(message)):
        workspace.scale_of(workspace.manifest(str(tmp_path / "openpilot.yaml")))
