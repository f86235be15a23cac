"""Triggers: conditions over observed ground truth, checked, total, and never more than data."""

from collections.abc import Mapping

from mutator.model import Hold, Trigger

VARIABLES = ("t", "d_rel", "v_ego", "v_lead", "hwt", "rs")


def check_condition(text: str, constants: Mapping[str, float] | None = None) -> str:
    """The condition in its one canonical text, constants replaced by their numbers.

    Allowed: the variables, numbers, `True`, comparisons, and/or/not, + - * /, abs/min/max. Anything else
    raises MutatorError (without place: the caller knows file and line).
    """
    raise NotImplementedError


def to_code(condition: str) -> str:
    """Python source of a checked condition that cannot raise: division goes through the probe's `_div`."""
    raise NotImplementedError


def evaluate(condition: str, values: Mapping[str, float]) -> bool:
    """What the probe would decide for these values of `VARIABLES` (missing hwt and rs are derived)."""
    raise NotImplementedError


def always(*, armed_after_s: float = 0.0) -> Trigger:
    """Fires at the first observation after arming and stays."""
    return Trigger(name="always", condition="True", hold=Hold.TO_END, armed_after_s=armed_after_s)


def at_time(time_s: float, *, name: str = "random", hold: Hold = Hold.TO_END) -> Trigger:
    """Fires at the first step whose start is not before `time_s`."""
    return Trigger(name=name, condition=f"t >= {float(time_s)!r}", hold=hold)


def draw_time(seed: int, key: str, *, first_s: float, last_s: float, step_s: float) -> float:
    """A time uniform on the steps from `first_s` to `last_s` (both included), drawn from (seed, key).

    The result is exactly `frame * step_s`, the time a target reports at the start of that step.
    """
    raise NotImplementedError
