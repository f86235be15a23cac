"""Files of saved experiments."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from mutator.campaigns.expectations import NO_HAZARD, Expectation
from mutator.campaigns.regression_files import load_regressions, save_regression
from mutator.errors import MutatorError
from mutator.model import AfterHazard, Experiment, Method

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
