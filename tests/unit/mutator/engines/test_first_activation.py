"""Predictions of the step at which a mutant's fault becomes active."""

import math
import random
from dataclasses import replace

import pytest

from mutator.engines.first_activation import ForkPoint, GoldenObservations, find_fork_point
from mutator.model import Hold, Trigger
from mutator.mutants.mutant_building import build
from mutator.mutants.probe_contract import ProbeSource, probe_attributes_after
from mutator.triggers.trigger_kinds import always_trigger, trigger_at_time
from mutator.workspace import Workspace


@pytest.fixture
def probe(toycar: Workspace):
    manifest, models = toycar.manifest("toycar"), toycar.fault_models()

    def make(trigger: Trigger) -> ProbeSource:
        return build(manifest, models, None, trigger).probe_source

    return make


GAPS = (50.0, 40.0, 30.0, 20.0, 30.0, 40.0)
SEEN = GoldenObservations(
    values=tuple((0.05 * i, gap, 10.0, 10.0) for i, gap in enumerate(GAPS)),
    counts_before_steps=(0, 1, 2, 3, 4, 5),
)


@pytest.mark.parametrize(
    ("trigger", "step"),
    [
        (always_trigger(), 0),
        (always_trigger(armed_after_s=0.1), 2),
        (trigger_at_time(0.07), 2),
        (trigger_at_time(9.0), None),
        (Trigger(name="x", condition="d_rel <= 30.0"), 2),
        (Trigger(name="x", condition="hwt < 2.5", hold=Hold.FOR, hold_s=0.1), 3),
        (Trigger(name="x", condition="d_rel <= 30.0", armed_after_s=0.19), 4),
        (Trigger(name="x", condition="d_rel < 0.0 or rs > 0.0"), None),
    ],
)
def test_a_fork_starts_at_the_first_active_step(probe, trigger: Trigger, step: int | None) -> None:
    start = find_fork_point(probe(trigger), SEEN)
    assert (start.step if start else None) == step
    if start:
        assert start.observation_count == step
        assert start.last_time_s == (SEEN.values[step - 1][0] if step else None)


@pytest.mark.parametrize("hold", [Hold.WHILE, Hold.TO_END])
@pytest.mark.parametrize("armed_after_s", [0.0, 0.1, 1.0])
@pytest.mark.parametrize(
    "condition",
    [
        "t >= 0.4 and v_ego > 0.0",
        "hwt < 1.5",
        "rs > 2.0 and d_rel / v_lead < 3.0",
        "d_rel < 0.0 or hwt > 9.0",
        "not (d_rel > 5.0 or rs <= -3.0)",
        "min(d_rel, v_ego, rs) < 0.0 < max(hwt, v_lead)",
        "hypot(d_rel, v_ego) == hypot(v_ego, d_rel) and d_rel / v_ego > d_rel / v_lead",
        "abs(rs) * 0.1 + t - 1.0 >= 3.0",
        "True",
    ],
)
def test_the_predicted_activation_step_agrees_with_the_probe(
    probe, condition: str, armed_after_s: float, hold: Hold
) -> None:
    draw = random.Random(condition)
    code = probe(Trigger(name="x", condition=condition, armed_after_s=armed_after_s, hold=hold))
    for _ in range(10):
        truth = [
            tuple(draw.choice((0.0, math.inf, math.nan, draw.uniform(0, 40))) for _ in range(3))
            for _ in range(40)
        ]
        values = tuple((0.05 * i, *others) for i, others in enumerate(truth))
        module: dict = {}
        exec(code.text, module)
        active = []
        for one in values:
            module["observe"](*one)
            active.append(module["_run"].active)
        start = find_fork_point(code, GoldenObservations(values=values, counts_before_steps=tuple(range(40))))
        assert (start.step if start else None) == (active.index(True) if True in active else None)


def test_the_probes_template_determines_the_precision_of_the_arming_time(probe) -> None:
    one = probe(Trigger(name="x", condition="True", armed_after_s=SEEN.values[3][0] + 0.001))
    changed = [
        tuple(text.replace("_TINY = 1e-9\n", f"_TINY = {tiny}\n") for text in one.code_parts)
        for tiny in (0.0, 0.002)
    ]
    assert [find_fork_point(replace(one, code_parts=shared), SEEN).step for shared in changed] == [4, 3]


def test_the_two_parts_of_a_probe_equal_the_whole_probe(probe) -> None:
    trigger = Trigger(name="x", condition="hwt < 2.0", hold=Hold.FOR, hold_s=0.1)
    whole, parts = {}, {}
    exec(compile(probe(trigger).text, "_fi", "exec"), whole)
    for part in probe(trigger).settings_and_code:
        exec(compile(part, "_fi", "exec"), parts)
    assert parts.keys() == whole.keys()
    for name, thing in whole.items():
        if hasattr(thing, "__code__"):
            assert parts[name].__code__ == thing.__code__
        elif isinstance(thing, str | float | list):
            assert parts[name] == thing
    assert probe(trigger).settings_and_code[1] == probe(always_trigger()).settings_and_code[1]


def test_a_step_can_have_several_observations_or_none(probe) -> None:
    """The fork starts before the step in which the activating observation is made."""
    seen = GoldenObservations(values=SEEN.values, counts_before_steps=(0, 1, 3, 3, 6))
    starts = [find_fork_point(probe(trigger_at_time(0.05 * i)), seen) for i in range(6)]
    assert [start.step for start in starts if start] == [0, 1, 1, 3, 3, 3]
    assert starts[4] == ForkPoint(
        step=3, observation_count=3, earliest_time_s=SEEN.values[0][0], last_time_s=SEEN.values[2][0]
    )


@pytest.mark.parametrize("trigger", [trigger_at_time(0.2), Trigger(name="x", condition="d_rel <= 20.0")])
def test_a_probe_with_restored_state_equals_one_that_observed_the_steps(probe, trigger: Trigger) -> None:
    start = find_fork_point(probe(trigger), SEEN)
    saw: dict = {}
    given: dict = {}
    for module in (saw, given):
        exec(probe(trigger).text, module)
    for values in SEEN.values[: start.observation_count]:
        saw["observe"](*values)
    holder, state = probe_attributes_after(start.observation_count, start.earliest_time_s, start.last_time_s)
    for name, value in state.items():
        setattr(given[holder], name, value)
    states = [
        {name: getattr(module["_run"], name) for name in module["_Run"].__slots__} for module in (saw, given)
    ]
    assert states[0] == states[1]
    assert not math.isinf(states[0]["t"])


def test_the_first_active_step_is_computed_once_per_trigger(probe) -> None:
    one, other = (probe(Trigger(name=name, condition="d_rel <= 30.0")) for name in ("one", "other"))
    assert one != other
    assert find_fork_point(one, SEEN) is find_fork_point(other, SEEN)
    assert find_fork_point(probe(Trigger(name="one", condition="d_rel <= 20.0")), SEEN) != find_fork_point(
        one, SEEN
    )
