"""The kinds of triggers."""

import math

import pytest

from mutator.errors import MutatorError
from mutator.model import Hold
from mutator.triggers.conditions import evaluate_condition
from mutator.triggers.trigger_kinds import always_trigger, draw_trigger_time, parse_trigger, trigger_at_time

FOLLOWING = {"t": 3.0, "d_rel": 40.0, "v_ego": 20.0, "v_lead": 18.0}


def test_the_text_of_a_trigger_decides_its_kind() -> None:
    assert parse_trigger("always", 1.5, ("t", "hwt")) == always_trigger(armed_after_s=1.5)
    assert parse_trigger("12.5", 1.5, ("t", "hwt")) == trigger_at_time(12.5)
    typed = parse_trigger("hwt<=2", 1.5, ("t", "hwt"))
    assert (typed.condition, typed.armed_after_s, typed.hold) == ("hwt <= 2.0", 1.5, Hold.WHILE)


@pytest.mark.parametrize("text", ["", "soon", "nan", "hwt", "1 +"])
def test_invalid_text_is_refused(text: str) -> None:
    with pytest.raises(MutatorError):
        parse_trigger(text, 0.0, ("t", "hwt"))


def test_always_and_a_time_last_to_the_end_of_the_run() -> None:
    """A time that somebody chose has its own name: nothing was drawn at random."""
    assert always_trigger().hold is Hold.TO_END
    assert trigger_at_time(3).condition == "t >= 3.0"
    assert trigger_at_time(3).hold is Hold.TO_END
    assert (trigger_at_time(3).name, parse_trigger("2.5", 0.0, ()).name) == ("at 3 s", "at 2.5 s")
    assert (trigger_at_time(3, hold_s=2.0).hold, trigger_at_time(3, hold_s=2.0).hold_s) == (Hold.FOR, 2.0)
    with pytest.raises(MutatorError, match="time nan"):
        trigger_at_time(math.nan)
    assert evaluate_condition(trigger_at_time(3).condition, FOLLOWING)
    assert not evaluate_condition(trigger_at_time(3.01).condition, FOLLOWING)


def test_random_times_are_starts_of_steps() -> None:
    times = [draw_trigger_time(7, f"key {i}", first_s=1.5, last_s=29.5, step_s=0.01) for i in range(300)]
    assert times == [
        draw_trigger_time(7, f"key {i}", first_s=1.5, last_s=29.5, step_s=0.01) for i in range(300)
    ]
    assert all(1.5 <= t <= 29.5 and t == round(t * 100) / 100 for t in times)
    assert min(times) < 3.0 and max(times) > 28.0
    assert {draw_trigger_time(i, "k", first_s=0.1, last_s=0.2, step_s=0.1) for i in range(50)} == {0.1, 0.2}


def test_random_times_need_a_valid_seed_and_interval() -> None:
    with pytest.raises(MutatorError, match="seed -1; expected a number from 0 to "):
        draw_trigger_time(-1, "k", first_s=1.0, last_s=2.0, step_s=0.01)
    with pytest.raises(MutatorError, match="expected an end that is not before"):
        draw_trigger_time(1, "k", first_s=2.0, last_s=1.0, step_s=0.01)
