"""The kinds of triggers: each makes a `Trigger` from a condition and a hold.

A kind is a function that makes its triggers and, if users can type it, a parser in `TRIGGER_PARSERS`.
"""

import math
from collections.abc import Callable, Collection
from dataclasses import replace

from mutator._common.phrase_texts import planned_number_text
from mutator._common.random_streams import random_generator
from mutator.errors import MutatorError
from mutator.model import Hold, Trigger
from mutator.triggers.conditions import canonical_condition

ALWAYS_NAME = "always"  # the trigger of a permanent fault
CONDITION_NAME = "condition"  # every trigger of a typed condition


def always_trigger(*, armed_after_s: float = 0.0) -> Trigger:
    """Return a trigger that fires at the first observation after arming and stays active."""
    return Trigger(name=ALWAYS_NAME, condition="True", hold=Hold.TO_END, armed_after_s=armed_after_s)


def trigger_at_time(time_s: float, *, name: str | None = None, hold_s: float | None = None) -> Trigger:
    """Return a trigger that fires at the first step that starts at `time_s` or later.

    It stays active for `hold_s`, or to the end of the run. Default name: the time, `at 10 s`.
    """
    if not math.isfinite(time_s):
        raise MutatorError(f"time {time_s}", expected="a finite number of seconds")
    hold = Hold.TO_END if hold_s is None else Hold.FOR
    name = name or f"at {planned_number_text(time_s, 's')}"
    return Trigger(name=name, condition=f"t >= {float(time_s)!r}", hold=hold, hold_s=hold_s)


def held_for(trigger: Trigger, hold_s: float) -> Trigger:
    """Return the trigger with a hold of `hold_s` seconds after it first fires, instead of its own."""
    return replace(trigger, hold=Hold.FOR, hold_s=float(hold_s))


def named_with_hold(trigger: Trigger) -> Trigger:
    """Return the trigger with its hold in its name, `at 3 s for 2 s`; unchanged without the hold `for`."""
    if trigger.hold is not Hold.FOR or trigger.hold_s is None:
        return trigger
    return replace(trigger, name=f"{trigger.name}{_hold_in_name(trigger.hold_s)}")


def name_without_hold(name: str, hold_s: float | None) -> str:
    """Return a trigger's name without the hold that `named_with_hold` added; unchanged without one."""
    return name if hold_s is None else name.removesuffix(_hold_in_name(hold_s))


def _hold_in_name(hold_s: float) -> str:
    return f" for {planned_number_text(hold_s, 's')}"


def trigger_time_s(trigger: Trigger) -> float | None:
    """Return the time at which a trigger of `trigger_at_time` fires; None for other triggers."""
    name, _, time = trigger.condition.partition(" >= ")
    try:
        return float(time) if name == "t" else None
    except ValueError:
        return None


def draw_trigger_time(seed: int, key: str, *, first_s: float, last_s: float, step_s: float) -> float:
    """Draw the time of a step from `first_s` to `last_s` (both included). All steps are equally likely.

    `seed` and `key` determine the result, which is rounded to nine decimals for readability.
    """
    first, last = round(first_s / step_s), round(last_s / step_s)
    if last < first:
        got = f"random times from {first_s:g} s to {last_s:g} s"
        raise MutatorError(got, expected="an end that is not before the beginning")
    frame = first + int(random_generator(seed, key).random() * (last - first + 1))
    return round(frame * step_s, 9)


def _parse_always(text: str, armed_after_s: float, variables: Collection[str]) -> Trigger | None:
    return always_trigger(armed_after_s=armed_after_s) if text == ALWAYS_NAME else None


def _parse_time(text: str, armed_after_s: float, variables: Collection[str]) -> Trigger | None:
    try:
        return trigger_at_time(float(text))
    except ValueError:
        return None


def _parse_condition(text: str, armed_after_s: float, variables: Collection[str]) -> Trigger:
    condition = canonical_condition(text, variables=variables)
    return Trigger(name=CONDITION_NAME, condition=condition, armed_after_s=armed_after_s)


_TriggerParser = Callable[[str, float, Collection[str]], Trigger | None]


# a parser returns None for other kinds; the last one raises MutatorError
TRIGGER_PARSERS: tuple[_TriggerParser, ...] = (_parse_always, _parse_time, _parse_condition)
TRIGGER_FORMS = "a time in s, `always`, or a condition, e.g. 't > 3'"


def parse_trigger(text: str, armed_after_s: float, variables: Collection[str]) -> Trigger:
    """Parse a trigger that a user typed (`TRIGGER_FORMS`) over observed values; MutatorError if invalid."""
    parsed = (parse(text, armed_after_s, variables) for parse in TRIGGER_PARSERS)
    return next(trigger for trigger in parsed if trigger is not None)
