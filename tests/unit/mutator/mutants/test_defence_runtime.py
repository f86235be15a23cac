"""Defences in a run: when they act, what they change and report. The drives are worked out by hand."""

import sys
import types
from collections.abc import Iterator
from math import inf, isnan, nan
from pathlib import Path
from typing import Any

import pytest

from mutator.mutants.defended_target import defended_manifest
from mutator.workspace import Workspace

FILE = """\
schema: defence/1
name: {name}
about: A defence of a test.
role: safety_mechanism
kind: other
model: {model}
{body}
commands: {commands}
"""
MODEL = """\
class Model:
    def __init__(self, *, {parameters}):
        self.calls = []

    def reset(self):
        self.calls = []

    def update(self, since_s, sensed, applied):
        {update}
"""
BRAKES = "senses: {gap: {truth: d_rel}}\nparameters: {lowest_brake: {value: 0.5, unit: '-'}}\n"


@pytest.fixture(autouse=True)
def _modules() -> Iterator[None]:
    yield
    for name in [name for name in sys.modules if name.startswith("toycar")]:
        del sys.modules[name]


def runtime(toycar: Workspace, bodies: dict[str, str], model: str = "constant_command") -> Any:
    """Return the runtime `_fd` of a toy with defences of these names and bodies of their files."""
    folder = toycar.library / "defences"
    for name, body in bodies.items():
        commands = "[gas, brake]" if model == "own" else "[brake]"
        text = FILE.format(name=name, model=model, body=body, commands=commands)
        (folder / f"{name}.yaml").write_text(text)
    tree = toycar.defended(toycar.manifest("toycar"), bodies).tree
    package = sys.modules["toycar"] = types.ModuleType("toycar")
    for path in sorted(tree.files, key=lambda path: path.endswith("/_fd.py")):
        name = Path(path).stem
        if name.startswith("_fd"):
            module = types.ModuleType(f"toycar.{name}")
            exec(tree.files[path], module.__dict__)
            setattr(package, name, module)
            sys.modules[f"toycar.{name}"] = module
    return sys.modules["toycar._fd"]


def write_model(toycar: Workspace, update: str, parameters: str = "amount") -> None:
    text = MODEL.format(parameters=parameters, update=update)
    (toycar.templates / "defences" / "own.py").write_text(text)


def drive(fd: Any, gaps: list[float], brake: float = 0.0, start: float = 0.0) -> list[float]:
    """Drive with these distances, one a step of 0.1 s, and return the brake commands."""
    brakes = []
    for i, gap in enumerate(gaps):
        fd.observe(t=start + i * 0.1, d_rel=gap, v_ego=10.0, v_lead=5.0)
        extra = {} if "gap_read" not in fd.command.__code__.co_varnames else {"gap_read": gap}
        _, commanded, _ = fd.command(gas=0.0, brake=brake, wheel_turn=0.0, **extra)
        brakes.append(commanded)
    return brakes


def test_a_defence_changes_commands_while_its_condition_holds(toycar: Workspace) -> None:
    """It acts in the step in which the condition holds, and no longer than that."""
    fd = runtime(toycar, {"d": f"{BRAKES}acts_when: gap < 10"})
    assert drive(fd, [20, 9, 8, 11, 9]) == [0.0, 0.5, 0.5, 0.0, 0.5]
    assert fd.report() == {
        "d": {
            "first": 0.1,
            "last": 0.4,
            "activations": 2,
            "steps": 3,
            "conflicts": 0,
            "changes": {"brake": 0.5},
            "values": {"brake": 0.5},
        }
    }


def test_a_condition_must_have_held_for_its_time(toycar: Workspace) -> None:
    """0.2 s after it began to hold the defence acts; a gap in between starts the time again."""
    fd = runtime(toycar, {"d": f"{BRAKES}acts_when: gap < 10\nacts_after_s: 0.2"})
    assert drive(fd, [9, 9, 20, 9, 9, 9, 9]) == [0.0, 0.0, 0.0, 0.0, 0.0, 0.5, 0.5]


def test_hysteresis_keeps_a_defence_active(toycar: Workspace) -> None:
    """It lets go only when the other condition has held for its time, and needs the first to act again."""
    body = f"{BRAKES}acts_when: gap < 10\nlets_go_when: gap > 15\nlets_go_after_s: 0.1"
    fd = runtime(toycar, {"d": body})
    assert drive(fd, [9, 12, 16, 14, 16, 16, 12, 9]) == [0.5, 0.5, 0.5, 0.5, 0.5, 0.0, 0.0, 0.5]


def test_a_delayed_sense_has_the_newest_old_enough_value(toycar: Workspace) -> None:
    """Until there is one that is 0.2 s old, the first value is sensed."""
    body = BRAKES.replace("truth: d_rel", "truth: d_rel, delay_s: 0.2")
    fd = runtime(toycar, {"d": f"{body}acts_when: gap < 10"})
    assert drive(fd, [9, 20, 20, 20, 9, 9, 9]) == [0.5, 0.5, 0.5, 0.0, 0.0, 0.0, 0.5]


def test_noise_is_the_same_in_each_run_and_another_for_each_defence(toycar: Workspace) -> None:
    """A run that restarts senses the same values."""
    body = BRAKES.replace("truth: d_rel", "truth: d_rel, noise: 3.0") + "acts_when: gap < 10"
    fd = runtime(toycar, {"d": body})
    gaps = [10.0] * 40
    first, second = drive(fd, gaps), drive(fd, gaps)
    assert first == second
    assert {0.0, 0.5} == set(first)
    assert drive(runtime(toycar, {"e": body}), gaps) != first


def test_a_change_within_the_tolerance_is_no_activation(toycar: Workspace) -> None:
    """The command is changed, but the defence has not acted."""
    fd = runtime(toycar, {"d": f"{BRAKES}acts_when: gap < 10"})
    assert drive(fd, [9], brake=0.495) == [0.5]
    assert fd.report()["d"]["steps"] == 0


def test_the_highest_priority_decides_and_disjoint_ranges_conflict(toycar: Workspace) -> None:
    """The last defence wins; the one that it overrules completely has not acted."""
    releases = "senses: {gap: {truth: d_rel}}\nparameters: {highest_brake: {value: 0.1, unit: '-'}}\n"
    bodies = {
        "a": f"{releases}acts_when: gap < 8\npriority: 2",
        "b": f"{BRAKES}acts_when: gap < 10\npriority: 1",
    }
    fd = runtime(toycar, bodies)
    assert drive(fd, [9, 7, 7]) == [0.5, 0.1, 0.1]
    report = fd.report()
    assert {name: (entry["steps"], entry["conflicts"]) for name, entry in report.items()} == {
        "b": (3, 2),
        "a": (2, 2),
    }
    assert report["b"]["values"] == {"brake": 0.5}
    assert report["a"]["changes"] == {"brake": 0.1}


def test_a_finite_range_is_clipped_to_the_limits_of_the_command(toycar: Workspace) -> None:
    """A file cannot have such a bound, but its model can give one."""
    write_model(toycar, "return {'brake': (7.0, float('inf'))}")
    fd = runtime(toycar, {"d": "parameters: {amount: {value: 1, unit: '-'}}"}, model="own")
    assert drive(fd, [9]) == [1.0]


def test_the_controllers_command_is_untouched_outside_an_infinite_range(toycar: Workspace) -> None:
    fd = runtime(toycar, {"d": f"{BRAKES}acts_when: gap < 10"})
    assert drive(fd, [9], brake=1.2) == [1.2]


def test_a_model_gets_time_sensed_values_and_applied_commands(toycar: Workspace) -> None:
    """Before the first step, the applied commands are those of this step."""
    write_model(
        toycar,
        "self.calls.append((round(since_s, 6), dict(sensed), applied['brake'])); "
        "return {'brake': (applied['brake'] + 0.2, 1.0), 'gas': (0.0, 0.0)} if self.calls else {}",
    )
    body = "senses: {gap: {truth: d_rel}}\nderived: {half: {is: gap / 2, unit: m, about: half}}\n"
    body += "parameters: {amount: {value: 1, unit: '-'}}\nacts_when: half < 5"
    fd = runtime(toycar, {"d": body}, model="own")
    assert [round(brake, 6) for brake in drive(fd, [20, 9, 8])] == [0.0, 0.2, 0.4]
    assert [(t, sensed["half"], round(brake, 6)) for t, sensed, brake in fd._run.defences[0].model.calls] == [
        (0.0, 4.5, 0.0),
        (0.1, 4.0, 0.2),
    ]


def test_a_new_run_starts_with_new_states(toycar: Workspace) -> None:
    """When time restarts, nothing of the run before is left."""
    fd = runtime(toycar, {"d": f"{BRAKES}acts_when: gap < 10\nlets_go_when: gap > 100"})
    assert drive(fd, [9, 20]) == [0.5, 0.5]
    assert drive(fd, [20, 20]) == [0.0, 0.0]
    assert fd.report()["d"]["first"] is None


@pytest.mark.parametrize(
    ("update", "message"),
    [
        ("return {'wheel' + '_turn': (0.0, 0.0)}", "commands wheel_turn, which it may not"),
        ("return {'brake': (1.0, 0.0)}", "gives brake the range 1.0 to 0.0"),
        ("return {'brake': (float('nan'), 0.0)}", "gives brake the range nan to 0.0"),
    ],
)
def test_a_model_that_gives_something_else_fails(toycar: Workspace, update: str, message: str) -> None:
    write_model(toycar, update)
    fd = runtime(toycar, {"d": "parameters: {amount: {value: 1, unit: '-'}}"}, model="own")
    with pytest.raises(fd.CommandError, match=message):
        drive(fd, [9])


def test_without_an_observation_commands_are_unchanged(toycar: Workspace) -> None:
    """A target can command before it is first observed."""
    fd = runtime(toycar, {"d": f"{BRAKES}acts_when: gap < 10"})
    assert fd.command(gas=0.0, brake=0.1, wheel_turn=0.0) == (0.0, 0.1, 0.0)
    assert drive(fd, [9]) == [0.5]


def test_a_range_without_bounds_changes_nothing(toycar: Workspace) -> None:
    write_model(toycar, "return {'brake': (-INFINITY, INFINITY)}".replace("INFINITY", "float('inf')"))
    fd = runtime(toycar, {"d": "parameters: {amount: {value: 1, unit: '-'}}"}, model="own")
    assert drive(fd, [9], brake=1e300) == [1e300]


@pytest.mark.parametrize(("brake", "limited"), [(nan, 0.3), (inf, 0.5), (-inf, 0.3)])
def test_a_limit_stops_what_is_no_finite_number(toycar: Workspace, brake: float, limited: float) -> None:
    """NaN becomes the last value that reached the plant, 0.3; infinity the bound, or 0.3 where there is none.
    This is an activation, with the largest change that a number can say.
    """
    fd = runtime(toycar, {"d": "parameters: {highest_brake: {value: 0.5, unit: '-'}}"}, model="limit")
    assert drive(fd, [20], brake=0.3) == [0.3]
    fd.observe(t=0.1, d_rel=20.0, v_ego=10.0, v_lead=5.0)
    assert fd.command(gas=0.0, brake=brake, wheel_turn=0.0)[1] == limited
    report = fd.report()["d"]
    assert (report["steps"], report["changes"]) == (1, {"brake": sys.float_info.max})
    assert report["values"] == {"brake": limited}


@pytest.mark.parametrize("brake", [nan, inf, -inf])
def test_without_a_finite_value_before_it_the_plant_gets_none(toycar: Workspace, brake: float) -> None:
    """A limit of the rate has no range in its first step, yet does not let infinity pass, nor stick to it."""
    fd = runtime(toycar, {"d": "parameters: {rate_brake: {value: 1.0, unit: '-'}}"}, model="limit")
    assert drive(fd, [20, 20], brake=brake) == pytest.approx([0.0, 0.1 if brake == inf else 0.0])


def test_a_defence_that_takes_over_from_no_number_begins_at_0(toycar: Workspace) -> None:
    """Until it acts, the controller's command reaches the plant as it is."""
    fd = runtime(toycar, {"d": f"{BRAKES.replace('lowest', 'highest')}acts_when: gap < 10"})
    first, second = drive(fd, [20, 9], brake=nan)
    assert isnan(first) and second == 0.0


def test_a_division_by_a_parameter_needs_no_helper(toycar: Workspace) -> None:
    """Only a parameter that is not 0 is safe to divide by."""
    body = "senses: {gap: {truth: d_rel}}\n"
    body += "derived: {a: {is: gap / two, unit: m, about: a}, b: {is: a / zero, unit: m, about: b}}\n"
    body += "parameters: {two: {value: 2, unit: '-'}, zero: {value: 0, unit: '-'},"
    fd = runtime(toycar, {"d": body + " lowest_brake: {value: 0.5, unit: '-'}}\nacts_when: b > 9"})
    assert fd._decide_d(0.0, (8.0,), (), False) == (True, {"gap": 8.0, "a": 4.0, "b": inf})
    assert "_div" in fd._decide_d.__code__.co_names
    assert drive(fd, [8.0]) == [0.5]


def test_no_defences_leave_the_manifest_as_it_is(toycar: Workspace) -> None:
    manifest = toycar.manifest("toycar")
    assert defended_manifest(manifest, [], toycar.templates) is manifest
