"""The check of a library loads its defences, and fits them to the targets of the campaigns that name them."""

from dataclasses import replace

import pytest

from mutator.checks.library_check import defence_problems, library_problems
from mutator.workspace import Workspace


def texts(toycar: Workspace) -> list[str]:
    return [str(problem) for problem in defence_problems(toycar, toycar.manifest("toycar"))]


def change(toycar: Workspace, name: str, old: str, new: str) -> None:
    path = toycar.library / name
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new))


def test_the_shipped_defences_have_no_problem(clone: Workspace) -> None:
    assert defence_problems(clone, clone.manifest("openpilot")) == []


def test_the_check_of_a_library_has_the_problems_of_its_defences(toycar: Workspace) -> None:
    change(toycar, "defences/pedal_limit.yaml", "role: external_measure", "role: helper")
    problems = [str(problem) for problem in library_problems(toycar, "toycar")]
    assert sum("pedal_limit.yaml:4: 'helper' for 'role'" in problem for problem in problems) == 1


@pytest.mark.parametrize(
    ("name", "old", "new", "message"),
    [
        ("defences/emergency_brake.yaml", "value: 1.0", "value: 9", "9 for 'lowest_brake'; expected 0 to 1"),
        ("defences/emergency_brake.yaml", "[gas, brake]", "[gas, brak]", "'brak'; expected one of gas"),
        ("campaigns/defended.yaml", "[none, emergency_brake,", "[none, brakes,", "no defence 'brakes'"),
        ("targets/toycar.yaml", "is: brake,", "is: gas,", "'gas' of command brake is the same variable"),
    ],
)
def test_a_set_that_does_not_fit_is_one_problem(
    toycar: Workspace, name: str, old: str, new: str, message: str
) -> None:
    """Though several sets have the same defence."""
    change(toycar, name, old, new)
    (text,) = texts(toycar)
    assert message in text
    assert name.rpartition("/")[2] in text


def test_a_defence_that_no_campaign_names_is_checked_alone(toycar: Workspace) -> None:
    path = toycar.library / "defences" / "emergency_brake.yaml"
    text = path.read_text().replace("name: emergency_brake", "name: other")
    (toycar.library / "defences" / "other.yaml").write_text(text.replace("[gas, brake]", "[gas]"))
    (problem,) = texts(toycar)
    assert "nothing uses 'lowest_brake'" in problem


def test_a_set_is_fitted_to_the_target_of_its_campaign(toycar: Workspace) -> None:
    """Another target is skipped if the workspace names the folder of one, which need not be its folder."""
    path = toycar.library / "targets" / "toycar.yaml"
    text = path.read_text().replace("name: toycar", "name: other").replace("is: brake,", "is: gas,")
    path.with_stem("other").write_text(text)
    manifest = toycar.manifest("toycar")
    assert defence_problems(toycar, manifest) == []
    change(toycar, "campaigns/defended.yaml", "target: toycar", "target: other")
    (problem,) = defence_problems(toycar, manifest)
    assert "other.yaml" in str(problem)
    assert defence_problems(replace(toycar, target=manifest.root), manifest) == []


def test_a_name_that_is_too_long_is_said_plainly(toycar: Workspace) -> None:
    (toycar.library / "defences" / f"{'n' * 230}.yaml").write_text("")
    (problem,) = texts(toycar)
    assert "a name of 230 characters; expected at most 213" in problem
