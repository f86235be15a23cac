"""The probe in a run: triggers, holds, counts and stored values."""

import copy
import math
import random
import re
import types
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from mutator.model import Hold, Trigger
from mutator.mutants import probe_contract as contract
from mutator.targets.observed_values import Observation, ObservedValue
from mutator.triggers.conditions import canonical_condition, evaluate_condition
from mutator.workspace import Workspace


def probe(
    clone: Workspace, condition: str = "rs > 0", observation: Observation | None = None, **more: Any
) -> Any:
    """Return a new probe module with two injections, `a` and `b`."""
    observation = observation or clone.manifest("openpilot").observation
    trigger = Trigger(name="test", condition=canonical_condition(condition))
    settings = contract.build_probe_settings("m1", trigger, Hold.WHILE, ("a", "b"), observation, 0.1)
    module = types.ModuleType("_fi")
    models = clone.fault_models()
    exec(contract.render_probe(models.probe_templates, replace(settings, **more)).text, module.__dict__)
    return module


def drive(fi: Any, lead_speeds: str, start: float = 0.0) -> str:
    """Observe one step per character. At an `x`, the lead is slower than the car. Return a text in which `x`
    marks the active steps."""
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
def test_a_fault_is_held_as_requested(
    clone: Workspace, hold: Hold, seconds: float, armed: float, expected: str
) -> None:
    fi = probe(clone, hold=hold.value, hold_s=seconds, armed_after_s=armed)
    assert drive(fi, "..xxx..xx.") == expected


def test_the_report_has_times_and_counts(clone: Workspace) -> None:
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


def test_no_fault_is_active_before_the_first_observation(clone: Workspace) -> None:
    fi = probe(clone, condition="True")
    assert not fi.active("a")
    assert fi.report()["triggered"] is None


def test_a_new_run_discards_the_state_of_the_previous_one(clone: Workspace) -> None:
    """A run is new if its time goes back to the previous run's start or earlier."""
    fi = probe(clone, hold="to_end")
    assert drive(fi, ".x.", start=0.9) == ".xx"
    assert drive(fi, "..x", start=0.9) == "..x"
    assert fi.report()["triggered"]["steps"] == 1
    assert drive(fi, "x", start=0.5) == "x" and drive(fi, ".", start=0.4) == "."
    assert fi.report()["triggered"] is None


@pytest.mark.parametrize(
    ("times", "said"),
    [
        ((0.0, 0.1, 0.1), "observed twice: at 0.1 s, after 0.1 s"),
        ((0.0, 0.0), "observed twice: at 0.0 s, after 0.0 s"),
        ((0.0, 0.1, 0.2, 0.1), "time neither goes on nor starts again: at 0.1 s, after 0.2 s"),
        ((0.0, math.nan), "time neither goes on nor starts again: at nan s, after 0.0 s"),
        ((math.nan,), "time neither goes on nor starts again: at nan s"),
    ],
)
def test_time_that_does_not_advance_is_an_error(
    clone: Workspace, times: tuple[float, ...], said: str
) -> None:
    """The error is raised again when the report is requested, in case the target catches it."""
    fi = probe(clone)
    *before, last = times
    for t in before:
        fi.observe(t=t, d_rel=40.0, v_ego=20.0, v_lead=15.0)
    with pytest.raises(fi.ObservationError, match=re.escape(said)):
        fi.observe(t=last, d_rel=40.0, v_ego=20.0, v_lead=15.0)
    with pytest.raises(fi.ObservationError, match=re.escape(said)):
        fi.report()


def test_an_observed_value_that_is_not_a_number_is_an_error(clone: Workspace) -> None:
    fi = probe(clone)
    with pytest.raises(TypeError, match="NoneType"):
        fi.observe(t=0.0, d_rel=None, v_ego=20.0, v_lead=15.0)
    with pytest.raises(TypeError, match="NoneType"):
        fi.report()


def test_a_run_stops_in_the_step_after_its_limit(clone: Workspace) -> None:
    fi = probe(clone)
    fi.limit(3)
    drive(fi, "...")
    with pytest.raises(fi.StepLimit, match="more than 3 steps"):
        fi.observe(t=0.3, d_rel=1.0, v_ego=1.0, v_lead=1.0)
    assert drive(fi, "...") == "..."


def test_observed_values_can_be_named_like_variables_of_the_probe(clone: Workspace) -> None:
    names = ("run", "values", "error", "active", "float", "map")
    read = tuple(ObservedValue(name=name, text=f"now.{name}", unit="-", about="x") for name in names)
    observed = replace(clone.manifest("openpilot").observation, values=read, derived=())
    fi = probe(clone, " + ".join(names) + " > 14", observed)
    fi.observe(t=0.0, **dict.fromkeys(names, 2))
    assert not fi.active("a")
    fi.observe(t=0.1, **dict.fromkeys(names, 3))
    assert fi.active("a")


def test_derived_variables_are_computed(clone: Workspace) -> None:
    fi = probe(clone, condition="hwt > 1e6 and rs == -3 and 1 / v_ego > 5")
    fi.observe(t=0.0, d_rel=10.0, v_ego=0.0, v_lead=3.0)
    assert fi.active("a")


def test_the_probe_evaluates_conditions_like_the_harness(clone: Workspace) -> None:
    stream = random.Random(1)
    conditions = ["hwt <= 2 and rs > 0", "d_rel / rs < 3 or not t > 1", "1 <= v_ego / v_lead < abs(rs) * 2"]
    for condition in conditions:
        fi = probe(clone, condition=condition)
        for i in range(300):
            values = {
                name: stream.choice([0.0, 1.0, 2.5, 20.0, 40.0]) for name in ("d_rel", "v_ego", "v_lead")
            }
            fi.observe(t=i * 0.01, **values)
            speed, closing = values["v_ego"], values["v_ego"] - values["v_lead"]
            hwt = values["d_rel"] / speed if speed else math.inf
            known = {"t": i * 0.01, "hwt": hwt, "rs": closing, **values}
            assert fi.active("a") == evaluate_condition(canonical_condition(condition), known)


def test_drift_grows_with_steps_and_not_with_executions(clone: Workspace) -> None:
    fi = probe(clone)
    drive(fi, "xx.x")
    for _ in range(5):
        fi.active("a")
    assert fi.steps() == 3


def test_stored_values_are_reset_at_each_activation(clone: Workspace) -> None:
    fi = probe(clone)
    seen = []
    for i, mark in enumerate(".xxx.xx"):
        fi.observe(t=i * 0.1, d_rel=40.0, v_ego=20.0, v_lead=15.0 if mark == "x" else 20.0)
        if fi.active("a"):
            seen.append((fi.held("a", i), round(fi.elapsed(), 9)))
    assert seen == [(1, 0.0), (1, 0.1), (1, 0.2), (5, 0.0), (5, 0.1)]


def test_delayed_values_are_as_old_as_the_delay(clone: Workspace) -> None:
    fi = probe(clone, condition="t >= 0.2")
    seen = []
    for i in range(8):
        fi.observe(t=i * 0.1, d_rel=1.0, v_ego=1.0, v_lead=1.0)
        if fi.active("a"):
            seen.append(fi.delayed("a", i, 0.2))
    assert seen == [2, 2, 2, 3, 4, 5]


def test_values_stored_for_a_run_outlast_an_activation(clone: Workspace) -> None:
    fi = probe(clone)
    made = iter(range(10))
    seen = []
    for run in range(2):
        for i, mark in enumerate("x.x"):
            fi.observe(t=i * 0.1, d_rel=40.0, v_ego=20.0, v_lead=15.0 if mark == "x" else 20.0)
            if fi.active("a"):
                seen.append((run, fi.kept("a", lambda: next(made)), fi.kept("b", lambda: next(made))))
    assert seen == [(0, 0, 1), (0, 0, 1), (1, 2, 3), (1, 2, 3)]


def test_noise_depends_only_on_its_seed(clone: Workspace) -> None:
    fi = probe(clone, condition="True")
    state = random.getstate()
    runs = []
    for number, seed in enumerate((1, 1, 2)):
        drive(fi, ".", start=-number)
        runs.append([fi.noise("a", 2.0, seed) for _ in range(200)])
    assert runs[0] == runs[1] != runs[2]
    assert 1.5 < math.sqrt(sum(x * x for x in runs[0]) / 200) < 2.5
    assert random.getstate() == state


FLIPS = [
    (1.0, 63, -1.0),
    (1.0, 62, math.inf),
    (0, 3, 8),
    (-1, 0, -2),
    (True, 1, 3),
    (1.0, 52, 0.5),
    (np.float64(1.0), 63, np.float64(-1.0)),
    (np.float32(1.0), 31, np.float32(-1.0)),
    (np.float32(1.0), 23, np.float32(0.5)),
    (np.float16(1.0), 15, np.float16(-1.0)),
    (np.int8(1), 7, np.int8(-127)),
    (np.uint8(1), 7, np.uint8(129)),
    (np.int16(-1), 0, np.int16(-2)),
    (np.uint16(0), 15, np.uint16(32768)),
    (np.int32(0), 31, np.int32(-(2**31))),
    (np.uint32(5), 0, np.uint32(4)),
    (np.int64(0), 63, np.int64(-(2**63))),
    (np.uint64(0), 63, np.uint64(2**63)),
    (np.bool_(True), 0, np.bool_(False)),
    (np.array([1.0, -2.0], "f4"), 31, np.array([-1.0, 2.0], "f4")),
    (np.array([1, 2], ">u2"), 8, np.array([257, 258], ">u2")),
    (np.array([True, False]), 0, np.array([False, True])),
    (np.array(1.0), 63, np.array(-1.0)),
    (np.arange(6, dtype="i4").reshape(2, 3)[:, ::2], 1, np.array([[2, 0], [1, 7]], "i4")),
]


@pytest.mark.parametrize(("value", "bit", "result"), FLIPS, ids=lambda one: str(getattr(one, "dtype", one)))
def test_a_bit_flip_keeps_the_type(clone: Workspace, value: Any, bit: int, result: Any) -> None:
    fi, before = probe(clone), copy.deepcopy(value)
    flipped = fi.flip_bit(value, bit)
    assert np.array_equal(flipped, result)
    assert np.array_equal(fi.flip_bit(flipped, bit), value)
    assert np.array_equal(value, before)
    assert getattr(flipped, "dtype", None) == getattr(value, "dtype", None)
    assert type(flipped) is (int if value is True else type(value))


@pytest.mark.parametrize(
    ("value", "bit"),
    [
        (np.float32(1.0), 32),
        (np.uint8(1), 8),
        (np.bool_(True), 1),
        (np.longdouble(1.0), 3),
        (np.complex64(1.0), 3),
        (np.array(["a"]), 0),
    ],
)
def test_a_bit_outside_the_type_is_an_error(clone: Workspace, value: Any, bit: int) -> None:
    with pytest.raises(ValueError, match=f"{value.dtype.name} has no bit {bit} to flip"):
        probe(clone).flip_bit(value, bit)


@pytest.mark.parametrize(
    ("value", "number", "kind"),
    [
        (3, 2.0, int),
        (True, 2.0, int),
        (2**60, -2.0, int),
        (np.uint8(3), 2.0, int),
        (np.array([3], "i2"), 2.0, int),
        (3, 2.5, float),
        (3, math.inf, float),
        (3, math.nan, float),
        (3.0, 2.0, float),
        (np.float64(3.0), 2.0, float),
        (np.float32(3.0), 2.0, float),
        (np.array([3.0]), 2.0, float),
        ([3], 2.0, float),
        (None, 2.0, float),
    ],
)
def test_a_whole_number_gets_the_type_of_the_integer_that_it_replaces(
    clone: Workspace, value: Any, number: float, kind: type
) -> None:
    found = probe(clone).like(value, number)
    assert type(found) is kind
    assert found == number or math.isnan(number)
