"""Files of saved experiments."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from mutator.campaigns.expectations import NO_HAZARD, Expectation
from mutator.campaigns.regression_files import load_regressions, save_regression
from mutator.errors import MutatorError
from mutator.model import AfterHazard, Experiment, Method
from mutator.targets.hazard_severity import SeverityScale

Make = Callable[..., Experiment]


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "regressions" / "radar.yaml"


def test_experiments_are_read_as_they_were_saved(experiment: Make, file: Path) -> None:
    """With floats to the last digit, texts with quotes and colons, and the lines of the file."""
    first = experiment(value=0.1 + 0.2, trigger='at "3": é')
    second = experiment(value=2, method=Method.RANDOM, scenario="S2")
    save_regression(file, "toycar", first, Expectation(hazards=["H1"], severity="S2"), 'It says: "no".')
    loaded = save_regression(file, "toycar", second, NO_HAZARD, "")
    assert loaded == load_regressions(file)
    assert [entry.experiment for entry in loaded.experiments] == [first, second]
    assert [entry.experiment.id for entry in loaded.experiments] == [first.id, second.id]
    assert [entry.expectation.hazards for entry in loaded.experiments] == [["H1"], []]
    assert loaded.experiments[0].expectation.severity == "S2"
    lines = file.read_text().splitlines()
    assert [lines[(entry.line or 0) - 1].lstrip(" -").partition(":")[0] for entry in loaded.experiments] == [
        "about",
        "expect",
    ]


def test_an_experiment_is_saved_once_and_with_others_of_its_target(experiment: Make, file: Path) -> None:
    """A refused one leaves the file as it was."""
    save_regression(file, "toycar", experiment(), NO_HAZARD, "")
    before = file.read_bytes()
    for target, another, problem in (
        ("toycar", experiment(), "again"),
        ("pole", experiment(value=2), "experiments of target toycar"),
        ("toycar", replace(experiment(value=2), after_hazard=AfterHazard.STOP), "after_hazard 'stop'"),
    ):
        with pytest.raises(MutatorError, match=problem):
            save_regression(file, target, another, NO_HAZARD, "")
        assert file.read_bytes() == before


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ('"value": 1.0', '"value": 1.5', "was changed"),
        ('"seed": 7', '"seed": 8', "was changed"),
        ('"method"', '"how"', "was changed"),
        ('"hazards"', '"hazard"', "hazard"),
        ("regression/1", "regression/2", "regression/1"),
        ("target:", "targets:", "target"),
    ],
)
def test_what_was_changed_by_hand_is_refused(
    experiment: Make, file: Path, old: str, new: str, problem: str
) -> None:
    """An id is a digest of the content. The error names file and line."""
    save_regression(file, "toycar", experiment(), NO_HAZARD, "")
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new, 1))
    with pytest.raises(MutatorError, match=problem) as error:
        load_regressions(file)
    assert str(error.value).startswith(f"{file}:")


@pytest.mark.parametrize(
    ("changes", "problem"),
    [({"seed": "x"}, "seed"), ({"scenario": None}, "scenario"), ({"setting": ([],)}, "setting.0")],
)
def test_values_of_other_types_are_refused_even_with_the_right_id(
    experiment: Make, file: Path, changes: dict[str, Any], problem: str
) -> None:
    """Whoever wrote the file can compute an id, too."""
    save_regression(file, "toycar", experiment(), NO_HAZARD, "")
    text, forged = file.read_text(), replace(experiment(), **changes)
    old = {name: getattr(experiment(), name) for name in ("id", *changes)}
    for name, value in old.items():
        before, after = (f'"{name}": {json.dumps(v)}' for v in (value, getattr(forged, name)))
        assert before in text
        text = text.replace(before, after, 1)
    file.write_text(text)
    with pytest.raises(MutatorError, match=problem) as error:
        load_regressions(file)
    assert str(error.value).startswith(f"{file}:4: ")


@pytest.mark.parametrize(
    ("expectation", "problem"),
    [
        (Expectation(hazards=["H9"]), "hazard 'H9'"),
        (Expectation(severity="s1"), "severity 's1'; expected one of S0, S1"),  # sorts behind all of them
    ],
)
def test_what_the_target_does_not_have_cannot_be_expected(
    experiment: Make, file: Path, expectation: Expectation, problem: str
) -> None:
    """A class of severity that is written wrong would let everything pass."""
    classes = (("S0", 0.0, ""), ("S1", 2.0, ""))
    scale = SeverityScale(name="scale", about="", source="", classes=classes, contact="H1")
    loaded = save_regression(file, "toycar", experiment(), expectation, "")
    with pytest.raises(MutatorError, match=problem) as error:
        loaded.check_expectations(["H1"], scale)
    assert str(error.value).startswith(f"{file}:4: ")
