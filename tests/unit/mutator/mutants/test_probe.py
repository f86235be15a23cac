"""The probe: triggers, holds, counts and memory, and that the contract says what the template does."""

import math
import random
import re
import types
from typing import Any

import pytest

from mutator.errors import MutatorError
from mutator.model import Activation, Hold, Trigger
from mutator.mutants import probe as contract
from mutator.mutants.rendering import render
from mutator.triggers.conditions import check_condition, evaluate, to_code
from mutator.web import asset
from mutator.workspace import Workspace


def probe(clone: Workspace, condition: str = "rs > 0", **more: Any) -> Any:
    """A fresh probe module with two injections, `a` and `b`."""
    values = {"mutant": "m1", "hold": "while", "hold_s": 0.0, "armed_after_s": 0.0, "injections": ("a", "b")}
    values |= {"condition": to_code(check_condition(condition)), **more}
    module = types.ModuleType("_fi")
    models = clone.fault_models()
    exec(render(models.probe, values, models.folder / "_fi.py.j2"), module.__dict__)
    return module


def drive(fi: Any, lead_speeds: str, start: float = 0.0) -> str:
    """Observe one step a character, the lead slower than the host where it is `x`; what was active."""
    seen = ""
    for i, mark in enumerate(lead_speeds):
        fi.observe(t=start + i * 0.1, d_rel=40.0, v_ego=20.0, v_lead=15.0 if mark == "x" else 20.0)
        seen += "x" if fi.active("a") else "."
    return seen


@pytest.mark.parametrize(
    ("hold", "seconds", "armed", "expected"),
    [
        (Hold.WHILE, 0.0, 0.0, "..xxx..xx."),
        (Hold.TO_END, 0.0, 0.0, "..xxxxxxxx"),
        (Hold.FOR, 0.2, 0.0, "..xx......"),
        (Hold.FOR, 0.6, 0.0, "..xxxxxx.."),
        (Hold.WHILE, 0.0, 0.3, "...xx..xx."),
        (Hold.TO_END, 0.0, 0.5, ".......xxx"),
    ],
)
def test_hold_and_arming(clone: Workspace, hold: Hold, seconds: float, armed: float, expected: str) -> None:
    """A fault is active while, for a time after, or ever since its condition held, once armed."""
    fi = probe(clone, hold=hold.value, hold_s=seconds, armed_after_s=armed)
    assert drive(fi, "..xxx..xx.") == expected


def test_report(clone: Workspace) -> None:
    """The report tells the trigger's activity and each injection's executions, those that never ran too."""
    fi = probe(clone)
    drive(fi, "..xx.x")
    assert fi.report() == {
        "mutant": "m1",
        "triggered": {"first": 0.2, "last": 0.5, "steps": 3},
        "injections": {
            "a": {"first": 0.2, "last": 0.5, "count": 3},
            "b": {"first": None, "last": None, "count": 0},
        },
    }


def test_nothing_before_the_first_observation(clone: Workspace) -> None:
    """Injected statements that run before ground truth is known stay inactive."""
    fi = probe(clone, condition="True")
    assert not fi.active("a")
    assert fi.report()["triggered"] is None


def test_a_new_run_starts_afresh(clone: Workspace) -> None:
    """When time starts again, nothing is left of the run before, not even one of a single step."""
    fi = probe(clone, hold="to_end")
    assert drive(fi, ".x.") == ".xx"
    assert drive(fi, "..x") == "..x"
    assert fi.report()["triggered"]["steps"] == 1
    assert drive(fi, "x") == "x" and drive(fi, ".") == "."
    assert fi.report()["triggered"] is None


def test_step_limit(clone: Workspace) -> None:
    """A run is stopped in the step after its limit; a new run has the whole limit again."""
    fi = probe(clone)
    fi.limit(3)
    drive(fi, "...")
    with pytest.raises(fi.StepLimit, match="more than 3 steps"):
        fi.observe(t=0.3, d_rel=1.0, v_ego=1.0, v_lead=1.0)
    assert drive(fi, "...") == "..."


def test_derived_variables(clone: Workspace) -> None:
    """Headway is infinite at standstill; relative speed is own minus lead's; division never raises."""
    fi = probe(clone, condition="hwt > 1e6 and rs == -3 and 1 / v_ego > 5")
    fi.observe(t=0.0, d_rel=10.0, v_ego=0.0, v_lead=3.0)
    assert fi.active("a")


def test_probe_and_planner_agree(clone: Workspace) -> None:
    """The probe decides as `trigger.evaluate` does, on observations with all kinds of corners."""
    stream = random.Random(1)
    conditions = ["hwt <= 2 and rs > 0", "d_rel / rs < 3 or not t > 1", "1 <= v_ego / v_lead < abs(rs) * 2"]
    for condition in conditions:
        fi = probe(clone, condition=condition)
        for i in range(300):
            values = {
                name: stream.choice([0.0, 1.0, 2.5, 20.0, 40.0]) for name in ("d_rel", "v_ego", "v_lead")
            }
            fi.observe(t=i * 0.01, **values)
            assert fi.active("a") == evaluate(check_condition(condition), {"t": i * 0.01, **values})


def test_drift_counts_steps_not_executions(clone: Workspace) -> None:
    """`steps` grows by one in each active observation, however often an injection runs."""
    fi = probe(clone)
    drive(fi, "xx.x")
    for _ in range(5):
        fi.active("a")
    assert fi.steps() == 3


def test_held_and_elapsed_belong_to_a_stretch_of_activity(clone: Workspace) -> None:
    """What is remembered, and the time, start anew when the fault becomes active again."""
    fi = probe(clone)
    seen = []
    for i, mark in enumerate(".xxx.xx"):
        fi.observe(t=i * 0.1, d_rel=40.0, v_ego=20.0, v_lead=15.0 if mark == "x" else 20.0)
        if fi.active("a"):
            seen.append((fi.held("a", i), round(fi.elapsed(), 9)))
    assert seen == [(1, 0.0), (1, 0.1), (1, 0.2), (5, 0.0), (5, 0.1)]


def test_delay(clone: Workspace) -> None:
    """The first value is held until a value is old enough; from then on the delay is kept."""
    fi = probe(clone, condition="t >= 0.2")
    seen = []
    for i in range(8):
        fi.observe(t=i * 0.1, d_rel=1.0, v_ego=1.0, v_lead=1.0)
        if fi.active("a"):
            seen.append(fi.delayed("a", i, 0.2))
    assert seen == [2, 2, 2, 3, 4, 5]


def test_kept_for_a_whole_run(clone: Workspace) -> None:
    """What an injection keeps outlives its stretches of activity, is its own, and ends with the run."""
    fi = probe(clone)
    made = iter(range(10))
    seen = []
    for run in range(2):
        for i, mark in enumerate("x.x"):
            fi.observe(t=i * 0.1, d_rel=40.0, v_ego=20.0, v_lead=15.0 if mark == "x" else 20.0)
            if fi.active("a"):
                seen.append((run, fi.kept("a", lambda: next(made)), fi.kept("b", lambda: next(made))))
    assert seen == [(0, 0, 1), (0, 0, 1), (1, 2, 3), (1, 2, 3)]


def test_noise_repeats_with_every_run(clone: Workspace) -> None:
    """Noise depends on its seed alone, differs between seeds, and leaves the shared generator alone."""
    fi = probe(clone, condition="True")
    state = random.getstate()
    runs = []
    for seed in (1, 1, 2):
        drive(fi, ".")
        runs.append([fi.noise("a", 2.0, seed) for _ in range(200)])
    assert runs[0] == runs[1] != runs[2]
    assert 1.5 < math.sqrt(sum(x * x for x in runs[0]) / 200) < 2.5
    assert random.getstate() == state


@pytest.mark.parametrize(
    ("value", "bit", "result"),
    [(1.0, 63, -1.0), (1.0, 62, math.inf), (0, 3, 8), (-1, 0, -2), (True, 1, 3), (1.0, 52, 0.5)],
)
def test_bit_flips(clone: Workspace, value: float, bit: int, result: float) -> None:
    """Flipping a bit changes the number as its representation says, and flipping it again restores it."""
    fi = probe(clone)
    assert fi.flip_bit(value, bit) == result
    assert fi.flip_bit(fi.flip_bit(value, bit), bit) == value


TRIGGER = Trigger(name="near", condition="hwt < 2.0 and rs > 0.0", armed_after_s=0.25)


def source(clone: Workspace, trigger: Trigger = TRIGGER) -> str:
    """The text of a probe that is rendered as a mutant's is."""
    models = clone.fault_models()
    values = contract.template_values("0123456789abcdef", trigger, trigger.hold, ("0a1b2c3d", "4e5f6071"))
    return render(models.probe, values, models.folder / "_fi.py.j2")


def test_the_decision_is_the_probes(clone: Workspace) -> None:
    """Asked directly, a probe is first active when `observe` says so."""
    code = compile(source(clone), "_fi", "exec")
    armed_t, holds = contract.decision(code)
    module: dict[str, Any] = {}
    exec(code, module)
    draw = random.Random(7)
    for _ in range(200):
        values = (draw.uniform(0.0, 0.5), draw.uniform(0.0, 50.0), draw.choice((0.0, 20.0)), 15.0)
        module["_run"] = module["_Run"]()
        module["observe"](*values)
        assert module["_run"].active == (values[0] >= armed_t and holds(*contract.truth(*values)))


def test_calls_and_tags_are_found_again(clone: Workspace) -> None:
    """What the contract writes it recognizes: import, observation, guards, and the ids in them."""
    lines = {
        contract.import_statement("car"): ("probe", 0, False),
        contract.tagged(contract.observe_call([("t", "now.time")]), contract.OBSERVE_TAG): (
            "observe",
            0,
            False,
        ),
        contract.tagged('if _fi.active("0a1b2c3d"):', "0a1b2c3d"): ("0a1b2c3d", 0, True),
        contract.tagged('if not _fi.active("0a1b2c3d"):', "0a1b2c3d", 12): ("0a1b2c3d", 12, True),
        contract.tagged("    x = 1", "0a1b2c3d"): ("0a1b2c3d", 0, True),
    }
    for line, (name, guarded, of_fault) in lines.items():
        for end in ("", "\n", "\r\n"):
            tag = contract.tag_of((line + end).encode())
            assert tag is not None
            assert (tag.id, tag.guarded, tag.of_fault) == (name, guarded, of_fault)
            assert tag.asks_probe == ("if " in line)
            assert tag.code.decode() == line.partition("  #")[0]
        assert contract.instrumented_line(f"x = 1\n{line}\n".encode()) == 1
        assert contract.adds_fault(f"+{line}") is of_fault
        assert list(contract.tagged_additions(f"+{line}\n", 0, 999)) == [(1, len(line) + 1)]


def test_what_is_no_tag(clone: Workspace) -> None:
    """A tag ends its line, in lower case; a comment that only resembles one is the target's own."""
    for line in (
        b"x = 1",
        b"x = 1  # fi",
        b"x = 1  # fi:",
        b"x  # fi:ABC",
        b"x  # fi:abc, say",
        b"y  # fi:a guard:",
    ):
        assert contract.tag_of(line) is None
    assert contract.instrumented_line(b"wi_fi = 1\nx_fi = 2  # fi:A\n") is None


def test_settings_are_all_that_differs(clone: Workspace) -> None:
    """Probes of two triggers are equal but for their settings, and these are found by their names."""
    other = Trigger(name="x", condition="t >= 3.0", hold=Hold.FOR, hold_s=2.5, armed_after_s=1.0)
    rests, found = [], []
    for trigger in (TRIGGER, other):
        patch = "".join(f"+{line}\n" for line in source(clone, trigger).splitlines())
        spans = list(contract.settings(patch, 0, len(patch)))
        found.append({name: patch[begin:end] for begin, end, name in spans})
        for begin, end, _ in reversed(spans):
            patch = patch[:begin] + patch[end:]
        rests.append(patch)
    assert rests[0] == rests[1]
    assert found[1] == {
        "mutant": "0123456789abcdef",
        "id": "4e5f6071",
        "hold": "for",
        "hold_s": "2.5",
        "armed_after_s": "1.0",
        "condition": "t >= 3.0",
    }


def test_a_hold_time_is_needed() -> None:
    """A trigger that holds for a time must say how long."""
    with pytest.raises(MutatorError, match="holds for a time"):
        contract.template_values("m", Trigger(name="x", condition="True"), Hold.FOR, ())


NEVER = {"first": None, "last": None, "count": 0}
RAN = {"first": 0.5, "last": 2.0, "count": 3}


@pytest.mark.parametrize(
    "report", [{}, {"injections": {}}, {"injections": {"a": NEVER}}, {"injections": None}]
)
def test_no_activation(report: dict[str, Any]) -> None:
    """Reports without an executed injection have no activation."""
    assert contract.activation_of(report) is None


def test_reports_are_read(clone: Workspace) -> None:
    """Injections count together; the report of a mutant that never triggers reads like a probe's own."""
    early = {"first": 0.25, "last": 0.75, "count": 1}
    report = {"injections": {"a": RAN, "b": early, "c": NEVER}}
    assert contract.activation_of(report) == Activation(first=0.25, last=2.0, count=4)
    fi = probe(clone)
    for read in (contract.mutant_of, contract.was_triggered, contract.activation_of):
        assert read(fi.report()) == read(contract.silent_report("m1"))  # type: ignore[operator]
    drive(fi, "xx")
    assert contract.was_triggered(fi.report())
    assert contract.mutant_of(None) is None
    assert not contract.was_triggered(None)


def test_pages_are_told_the_tags() -> None:
    """The script that shows diffs spells no tag: the page carries the mark and the probe's own tags."""
    words = contract.tag_words()
    for tag in words["probe"]:
        assert contract.tagged("x", tag) == f"x  {words['mark']}{tag}"
    assert words["probe"] == [contract.IMPORT_TAG, contract.OBSERVE_TAG]
    assert "fi:" not in asset("diff.js")
    assert not re.search("|".join(rf"{tag}\W*\|" for tag in words["probe"]), asset("diff.js"))
