"""Files of defences and their models are checked; each error names its place and a remedy."""

import pytest

from mutator.defences.defence import Kind, Role
from mutator.errors import MutatorError
from mutator.workspace import Workspace

FILE = """\
schema: defence/1
name: d
about: A defence.
role: driver
kind: monitor
model: constant_command
senses: {gap: {truth: d_rel}, read: {controller: gap_read, delay_s: 0.1}}
derived: {error: {is: gap - read - offset, unit: m, about: difference}}
parameters: {offset: {value: 1, unit: m}, lowest_brake: {value: 0.5, unit: "-"}}
acts_when: abs(error) > 2
commands: [brake]
"""
CROSSING = "0.5; expected at most `highest_brake`, 0.4; swap or correct them"


def load(toycar: Workspace, text: str = FILE) -> object:
    (toycar.library / "defences" / "d.yaml").write_text(text)
    return toycar.defended(toycar.manifest("toycar"), ["d"])


def test_a_defence_has_what_its_file_says(toycar: Workspace) -> None:
    """Without `lets_go_when`, it ends when `acts_when` does not hold; the model gets only its parameters."""
    load(toycar)
    defence = toycar.defence("d")
    assert (defence.role, defence.kind, defence.priority) == (Role.DRIVER, Kind.MONITOR, 0.0)
    assert defence.lets_go_when == "not abs(error) > 2.0"
    assert defence.model_parameters == ("lowest_brake",)
    assert toycar.defence("pedal_limit").acts_when == "gap_read < 45.0"


def test_the_digest_covers_file_and_model(toycar: Workspace) -> None:
    load(toycar)
    before = toycar.defence("d").digest
    path = toycar.templates / "defences" / "constant_command.py"
    path.write_text(path.read_text() + "\n")
    assert toycar.defence("d").digest != before


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("role: driver\n", "", "'role' is missing"),
        ("role: driver", "role: helper", "helper"),
        ("name: d", "name: e", "'e'; expected 'd', the name of the file"),
        ("model: constant_command", "model: nothing", "'nothing'; expected one of .*constant_command"),
        ("truth: d_rel", "truth: d_rell", "'d_rell'; expected one of d_rel, v_ego, v_lead, hwt, rs"),
        ("truth: d_rel", "truth: t", "'t'; expected one of d_rel"),
        ("controller: gap_read", "controller: gap", "'gap'; expected one of gap_read, closing_read"),
        ("truth: d_rel", "truth: d_rel, controller: gap_read", "both `truth` and `controller`"),
        ("truth: d_rel", "noise: 1", "neither `truth` nor `controller`"),
        ("abs(error) > 2", "abs(errors) > 2", "unknown name 'errors'"),
        ("abs(error) > 2", "t > 2", "unknown name 't'"),
        ("lowest_brake", "lowest_brak", "nothing uses 'lowest_brak'"),
        ("lowest_brake", "lowest_gas", "nothing uses 'lowest_gas'"),
        ("lowest_brake", "peak_brake", "nothing uses 'peak_brake'; .*lowest_brake, highest_brake"),
        ("lowest_brake", "lowest_park_brake", "nothing uses 'lowest_park_brake'"),
        ("lowest_brake:", "highest_brake: {value: 0.4, unit: '-'}, lowest_brake:", CROSSING),
        ("offset: {value", "gap: {value", "'gap'; expected a unique name"),
        ("commands: [brake]", "commands: [brake, horn]", "'horn'; expected one of gas, brake, wheel_turn"),
        ("commands: [brake]", "commands: []", r"\[\] for 'commands'; expected at least one command"),
        ("commands: [brake]", "commands: [brake, brake]", "each command once, but 'brake' is there twice"),
        ("commands: [brake]", "commands: [brak]", "'brak'; expected one of gas, brake, wheel_turn"),
        ("commands: [brake]", "commands: [brake, gas]", "nothing changes 'gas'; expected .*lowest_gas or"),
        ("value: 0.5", "value: .nan", "nan"),
        ("value: 0.5", "value: true", "true for 'value'; expected a number"),
        ("value: 0.5", "value: '0.5'", "'0.5' for 'value'; expected a number"),
        ("role:", "priority: '1'\nrole:", "'1' for 'priority'; expected a number"),
        ("senses: {", "senses: {more: {truth: rs}, ", "nothing uses 'more'; expected a value of"),
        ("derived: {", "derived: {more: {is: gap, unit: m, about: more}, ", "nothing uses 'more'"),
        ("acts_when: abs(error) > 2", "acts_when: ''", "an empty text; expected a condition"),
        ("commands:", "lets_go_when: ' '\ncommands:", "an empty text; expected a condition; write one"),
    ],
)
def test_a_mistake_in_the_file_is_refused(toycar: Workspace, old: str, new: str, message: str) -> None:
    with pytest.raises(MutatorError, match=r"d\.yaml:\d+: .*" + message.replace("(", r"\(")):
        load(toycar, FILE.replace(old, new))


def test_a_defence_that_never_acts_is_refused(toycar: Workspace) -> None:
    text = FILE.replace("abs(error) > 2", "'False'").replace("lets_go", "# lets_go")
    text = text.replace("senses:", "# senses:").replace("derived:", "# derived:").replace("offset: ", "# ")
    text = text.replace("parameters: {# {value: 1, unit: m}, ", "parameters: {")
    with pytest.raises(MutatorError, match=r"d\.yaml:\d+: 'False', which never holds"):
        load(toycar, text)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("x-2", "'x-2'; expected a name of the letters a to z and A to Z, digits and _"),
        ("none", "'none'; expected another name: in a campaign, `none` is the run without defences"),
        ("n" * 214, r"expected at most 213 characters.*; shorten the name, and that of the file"),
    ],
)
def test_a_name_that_cannot_be_used_is_refused(toycar: Workspace, name: str, message: str) -> None:
    path = toycar.library / "defences" / f"{name}.yaml"
    path.write_text(FILE.replace("name: d", f"name: {name}"))
    with pytest.raises(MutatorError, match=rf"{name}\.yaml:2: .*{message}"):
        toycar.defence(name)


def test_a_negative_rate_is_refused(toycar: Workspace) -> None:
    text = FILE.replace("constant_command", "limit").replace(
        "lowest_brake: {value: ", "rate_brake: {value: -"
    )
    with pytest.raises(MutatorError, match=r"d\.yaml:\d+: .*-0.5; expected a largest change per second"):
        load(toycar, text)


def test_bounds_can_have_a_type(toycar: Workspace) -> None:
    """They refuse other words as those without one do."""
    code = 'BOUNDS: tuple[str, ...] = ("lowest",)\nclass Model:\n    def __init__(self, **any): ...\n'
    code += "    def reset(self): ...\n    def update(self, since_s, sensed, applied): ...\n"
    (toycar.templates / "defences" / "own.py").write_text(code)
    text = FILE.replace("constant_command", "own")
    load(toycar, text)
    with pytest.raises(MutatorError, match="peak_brake"):
        load(toycar, text.replace("lowest_brake", "peak_brake"))


def test_a_model_without_bounds_takes_any_word(toycar: Workspace) -> None:
    """What such a parameter means is the model's."""
    code = "class Model:\n    def __init__(self, **any): ...\n    def reset(self): ...\n"
    code += "    def update(self, since_s, sensed, applied): ...\n"
    (toycar.templates / "defences" / "own.py").write_text(code)
    load(toycar, FILE.replace("constant_command", "own").replace("lowest_brake", "peak_brake"))
    assert toycar.defence("d").model_parameters == ("peak_brake",)


def test_a_target_without_actuation_cannot_be_defended(toycar: Workspace) -> None:
    path = toycar.library / "targets" / "toycar.yaml"
    text = path.read_text()
    path.write_text(text[: text.index("actuation:")] + text[text.index("hazards: [") :])
    with pytest.raises(MutatorError, match="target toycar cannot be defended; expected `actuation`"):
        load(toycar)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("is: wheel,", "is: wheels,", "'wheels' is not known in Driver.drive"),
        ("is: wheel,", "is: abs(wheel),", "a name, an attribute or an item"),
        ("lowest: -1", "lowest: 2", "2; expected less than `highest`, 1"),
        ("gap_read: {is: gap", "gas: {is: gap", "'gas'; expected a unique name"),
        ('before_return: ""', 'return_value: ""', "an actuation at `return_value`"),
    ],
)
def test_a_mistake_in_the_actuation_is_refused(toycar: Workspace, old: str, new: str, message: str) -> None:
    path = toycar.library / "targets" / "toycar.yaml"
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new))
    with pytest.raises(MutatorError, match=rf"toycar\.yaml:\d+: .*{message}"):
        load(toycar)


def test_a_tree_that_looks_defended_is_refused(toycar: Workspace) -> None:
    """Lines with the tag would be taken for those of defences."""
    path = toycar.manifest("toycar").root / "toycar" / "haze.py"
    path.write_text(path.read_text() + "\nx = 1  # fd:import\n")
    with pytest.raises(MutatorError, match=r"haze\.py:\d+: the line ends in a `# fd:` tag"):
        load(toycar)
