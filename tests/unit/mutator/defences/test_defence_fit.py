"""A defence fits a target: its bounds, its units, and the variables of the target's commands."""

from pathlib import Path

import pytest

from mutator.defences.defence_fit import checked_actuation
from mutator.errors import MutatorError
from mutator.workspace import Workspace

from .test_defence_yaml import FILE, load

ROOT = Path(__file__).parents[4]
GAS = 'gas: {is: gas, unit: "-", lowest: 0, highest: 1, tolerance: 0.01}'
EXAMPLES = ("cartpole", "highway", "opendbc")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('value: 0.5, unit: "-"', "value: 0.5, unit: m/s^2", "'m/s\\^2' for 'lowest_brake'; expected '-'"),
        ("value: 0.5", "value: 9", "9 for 'lowest_brake'; expected 0 to 1, the limits of .*command brake"),
        ("lowest_brake: {value: 0.5", "highest_brake: {value: -7", "-7 for 'highest_brake'; expected 0 to 1"),
        ("abs(error) > 2", "error > 2 and read < offset_s", "read in 'm' compared with offset_s in 's'"),
        (
            "abs(error) > 2",
            "error > 2 and max(gap, read) < offset_s",
            r"max\(gap, read\) in 'm' compared with",
        ),
        ("abs(error) > 2", "not (error > -offset_s)", "error in 'm' compared with -offset_s in 's'"),
    ],
)
def test_bounds_and_units_must_fit(toycar: Workspace, old: str, new: str, message: str) -> None:
    text = FILE.replace("parameters: {", "parameters: {offset_s: {value: 1, unit: s}, ")
    used = "" if "offset_s" in new else " and offset_s > 0"
    text = text.replace("abs(error) > 2", f"abs(error) > 2{used}")
    old = old if old in text else f"{old}{used}"
    assert old in text
    with pytest.raises(MutatorError, match=rf"d\.yaml:\d+: .*{message}"):
        load(toycar, text.replace(old, new))


@pytest.mark.parametrize("condition", ["gap < 2 * offset_s", "gap / offset_s > 2", "offset_s * gap > read"])
def test_units_that_are_not_decided_pass(toycar: Workspace, condition: str) -> None:
    text = FILE.replace("parameters: {", "parameters: {offset_s: {value: 1, unit: s}, ")
    load(toycar, text.replace("abs(error) > 2", f"abs(error) > 2 and {condition}"))


def test_a_full_command_must_be_within_the_limits(toycar: Workspace) -> None:
    code = "class Model:\n    def __init__(self, *, full_brake): ...\n    def reset(self): ...\n"
    code += "    def update(self, since_s, sensed, applied):\n        return {}\n"
    (toycar.templates / "defences" / "own.py").write_text(code)
    text = FILE.replace("constant_command", "own").replace(
        "lowest_brake: {value: 0.5", "full_brake: {value: 1.5"
    )
    with pytest.raises(MutatorError, match=r"1\.5 for 'full_brake'; expected 0 to 1"):
        load(toycar, text)


@pytest.mark.parametrize(
    ("variable", "message"),
    [
        (
            "gas",
            "'gas' of command gas2 is the same variable as 'gas' of command gas; expected a variable of its",
        ),
        ("gas.force", "'gas.force' of command gas2 is in the variable of 'gas' of command gas"),
    ],
)
def test_two_commands_that_are_one_variable_are_refused(
    toycar: Workspace, variable: str, message: str
) -> None:
    path = toycar.library / "targets" / "toycar.yaml"
    path.write_text(path.read_text().replace(GAS, f'{GAS}\n    gas2: {{is: {variable}, unit: "-"}}'))
    with pytest.raises(MutatorError, match=rf"toycar\.yaml:\d+: {message}.*; remove one of the commands"):
        load(toycar)


@pytest.mark.parametrize("ending", ["", "        self.pedals = None\n"])
def test_a_variable_that_stands_for_an_attribute_is_recognized(toycar: Workspace, ending: str) -> None:
    """Not if the function sets the attribute to something else."""
    driver = toycar.manifest("toycar").root / "toycar" / "driver.py"
    text = driver.read_text().replace("        gas =", "        pedals = self.pedals\n        gas =")
    driver.write_text(text.replace("        return gas", f"{ending}        return gas"))
    path = toycar.library / "targets" / "toycar.yaml"
    commands = 'a: {is: pedals.gas, unit: "-"}\n    b: {is: self.pedals.gas, unit: "-"}'
    path.write_text(path.read_text().replace(GAS, f"{GAS}\n    {commands}"))
    if ending:
        load(toycar)
    else:
        with pytest.raises(MutatorError, match=r"'self\.pedals\.gas' of command b is the same variable as"):
            load(toycar)


@pytest.mark.parametrize("name", EXAMPLES)
def test_the_defences_of_the_examples_fit(name: str, tmp_path: Path) -> None:
    """Their targets need not be installed: the place of the commands is in the example's own file."""
    library = ROOT / "examples" / name / "fault_library"
    workspace = Workspace.find(library=library, templates=ROOT / "templates", target=tmp_path)
    manifest = workspace.manifest(workspace.target_name())
    assert len(workspace.defences) == 2
    for defence in workspace.defences:
        checked_actuation(manifest, workspace.defence(defence))
