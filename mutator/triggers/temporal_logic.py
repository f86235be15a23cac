"""Signal temporal logic, evaluated by the optional package rtamt (extra `stl`)."""

import logging
import re
from collections.abc import Collection, Mapping
from fractions import Fraction
from typing import Any

import numpy as np

from mutator._common.message_text import spelling_suggestion
from mutator._common.version import extra_install_command
from mutator.errors import MutatorError
from mutator.triggers.conditions import TIME

_NAME_PATTERN = re.compile(r"\b[A-Za-z_]\w*\b")
_OUTPUT_NAME = "robustness_of_it"  # rtamt wants `name = formula`; no channel is named like this
_SYNTAX_ERROR_PATTERN = re.compile(r"1:(\d+): Syntax")  # of rtamt, with the column
# names of rtamt's classes of operators that look ahead: to the end of an interval, for ever, one step
_BOUNDED_OPERATORS = ("TimedAlways", "TimedEventually", "TimedUntil")
_UNBOUNDED_OPERATORS = ("Always", "Eventually", "Until")
_NEXT_OPERATORS = ("Next", "StrongNext")
_MOST_LENGTH = 1000  # characters of a formula
# of all intervals of a formula together; for some operators, rtamt's time grows with the square of it
MOST_INTERVAL_STEPS = 3000
_STEP_TOLERANCE = 0.01  # tolerance in steps; times are sums of steps, or rounded


def check_stl_formula(formula: str, variables: Collection[str], step_s: float) -> None:
    """Raise MutatorError if rtamt is missing, or cannot evaluate the formula in steps of `step_s`."""
    # NaN suffices: no arithmetic fails on it
    _evaluate(formula, {name: np.full(1, np.nan) for name in (*variables, TIME)}, step_s)


def names_in_stl(formula: str, variables: Collection[str]) -> tuple[str, ...]:
    allowed = set(variables)
    return tuple(dict.fromkeys(name for name in _NAME_PATTERN.findall(formula) if name in allowed))


def robustness_at_each_step(formula: str, values: Mapping[str, np.ndarray], step_s: float) -> np.ndarray:
    """Return how far each step is from violating the formula (below 0: violated).

    `values` has an array for each variable, and the time of each step. If the formula looks n steps ahead,
    its value for step i is known at step i + n and stored there; the first n entries are `inf`. MutatorError
    if steps are not `step_s` long, because the logic counts steps, not times.
    """
    time = values[TIME]
    lengths = np.diff(time)
    uneven = np.flatnonzero(~(np.abs(lengths - step_s) <= _STEP_TOLERANCE * step_s))
    if uneven.size:
        raise MutatorError(
            f"a step of {lengths[uneven[0]]:g} s at {time[uneven[0]]:g} s, but {formula!r} counts steps",
            expected=f"steps of {step_s:g} s, the manifest's `step_s`",
            remedy="record steps of equal length, or write the hazard with `when`",
        )
    return _evaluate(formula, values, step_s)


def _evaluate(formula: str, values: Mapping[str, np.ndarray], step_s: float) -> np.ndarray:
    if len(formula) > _MOST_LENGTH:
        raise MutatorError(f"a formula of {len(formula)} characters", expected=f"at most {_MOST_LENGTH}")
    specification = _new_specification(step_s)
    formula = " ".join(formula.split())
    names, steps = names_in_stl(formula, values), len(values[TIME])
    # rtamt needs at least two steps, so the last one is repeated, and its second value is dropped
    rows = {name: [*values[name].tolist(), *values[name][-1:].tolist()] for name in names}
    try:
        _parse_formula(specification, formula, names)
        _check_intervals(specification.ast.specs[-1], specification.offline_interpreter)
        steps_ahead = _steps_ahead(specification.ast.specs[-1], specification.offline_interpreter)
        robustness_by_step = specification.evaluate({**rows, "time": [*range(steps + 1)]}) if steps else []
    except Exception as error:  # rtamt raises KeyError, ValueError, errors of its own, and arithmetic errors
        raise _formula_error(error, formula, values, step_s) from None
    judged = [number for _, number in robustness_by_step[: max(0, steps - steps_ahead)]]
    return np.array([np.inf] * min(steps_ahead, steps) + judged, dtype=float)


def _new_specification(step_s: float) -> Any:
    try:
        import rtamt  # type: ignore[import-untyped]
    except ImportError:
        raise MutatorError(
            "a formula of signal temporal logic, but rtamt is not installed",
            expected="the package rtamt, which needs Python 3.11 or 3.12",
            remedy=f"{extra_install_command('stl')}, or write the condition with `when`",
        ) from None
    specification = rtamt.StlDiscreteTimeSpecification()
    specification.set_sampling_period(Fraction(step_s).limit_denominator(10**9), "s", 0.1)
    return specification


def _parse_formula(specification: Any, formula: str, names: Collection[str]) -> None:
    declared = {*names, _OUTPUT_NAME}
    for name in declared:
        specification.declare_var(name, "float")
    specification.spec = f"{_OUTPUT_NAME} = {formula}"
    previous_level = logging.root.manager.disable
    logging.disable(logging.WARNING)  # rtamt warns about an unknown name, which is rejected below
    try:
        specification.parse()
    finally:
        logging.disable(previous_level)
    specification.offline_interpreter.set_ast(specification.ast)
    if unknown := sorted(specification.ast.vars - declared):
        raise KeyError(unknown[0])


def _check_intervals(node: Any, interpreter: Any) -> None:
    """Raise ValueError if the intervals of a formula have too many steps together."""
    total, waiting = 0, [node]
    while waiting:
        node = waiting.pop()
        waiting += _children(node)
        total += int(interpreter.time_unit_transformer(node)[1]) if hasattr(node, "begin") else 0
    if total > MOST_INTERVAL_STEPS:
        raise ValueError(f"intervals of {total} steps")


def _children(node: Any) -> list[Any]:
    """Return a node's children; rtamt lists those of some operators twice."""
    return list({id(child): child for child in node.children}.values())


def _steps_ahead(node: Any, interpreter: Any) -> int:
    """Return how many steps a formula looks ahead; ValueError if unbounded."""
    kind = type(node).__name__
    if kind in _UNBOUNDED_OPERATORS:
        raise ValueError(f"unbounded {kind.lower()}")
    below: int = max((_steps_ahead(child, interpreter) for child in _children(node)), default=0)
    if not hasattr(node, "begin"):
        return below + (kind in _NEXT_OPERATORS)
    begin, end = interpreter.time_unit_transformer(node)
    if begin > end:
        raise ValueError("an interval that ends before it begins")
    return below + (int(end) if kind in _BOUNDED_OPERATORS else 0)


def _formula_error(error: Exception, formula: str, variables: Collection[str], step_s: float) -> MutatorError:
    """Turn rtamt's message into one for the formula's author."""
    message = str(error).removeprefix("RTAMT Exception: ").strip()
    remedy = "correct the formula"
    if position := _SYNTAX_ERROR_PATTERN.match(message):
        rest = formula[int(position[1]) - len(f"{_OUTPUT_NAME} = ") :]
        message = f"unexpected {rest!r}" if rest else "an unexpected end"
    elif isinstance(error, KeyError):
        name = str(error.args[0])
        message, remedy = f"unknown name '{name}'", f"correct it{spelling_suggestion(name, [*variables])}"
    elif "unbounded" in message:
        remedy = "bound the look-ahead, `always[0:2](x < 3)`, or look back: `historically(x < 3)`"
    elif message.startswith("intervals of"):
        longest = f"{MOST_INTERVAL_STEPS} steps together, {MOST_INTERVAL_STEPS * step_s:g} s here"
        remedy = f"shorten them: at most {longest}"
    elif "sampling period" in message:
        message, remedy = f"a time that is not a multiple of the step, {step_s:g} s,", "use a multiple"
    return MutatorError(
        f"{message} in {formula!r}",
        expected="a formula of signal temporal logic that looks back, or ahead for a bounded time, over "
        + ", ".join(variables),
        remedy=remedy,
    )
