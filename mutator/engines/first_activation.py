"""Find when a fault is first active, by evaluating its trigger on the golden run's observations.

Until then a mutant's run equals the golden run, so its probe observes the same values.
"""

import ast
import math
from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache, reduce
from typing import Any

import numpy as np

from mutator.engines.executed_functions import ExecutedFunctions
from mutator.mutants.probe_contract import ProbeSource
from mutator.triggers.trace_formulas import ARITHMETIC_FUNCTIONS, COMPARISON_FUNCTIONS


@dataclass(frozen=True, kw_only=True, eq=False)  # hashed by identity, because hashing all values is slow
class GoldenObservations:
    """What a probe observes in a golden run.

    `values` has a tuple for each observation: the time (s), then the observed values. `counts_before_steps`
    has the number of observations made before each step. `imported_modules` and `executed_functions` are
    those of the run.
    """

    values: tuple[tuple[float, ...], ...]
    counts_before_steps: tuple[int, ...]
    imported_modules: tuple[str, ...] = ()
    executed_functions: ExecutedFunctions | None = None

    @property
    def has_any_before_first_step(self) -> bool:
        """Whether a fork before the first step would miss an observation."""
        return bool(self.values) and self.counts_before_steps[:1] != (0,)

    @cached_property
    def columns(self) -> np.ndarray:
        return np.array(self.values, dtype=float).T

    def step_of_observation(self, observation: int) -> int:
        """Return the step of this observation. No observation is made before the first step."""
        return bisect_right(self.counts_before_steps, observation) - 1


@dataclass(frozen=True, slots=True, kw_only=True)
class ForkPoint:
    """The point where a mutant leaves the golden run: before `step`, after `observation_count` observations.

    The times are those of these observations; None without any.
    """

    step: int
    observation_count: int
    earliest_time_s: float | None
    last_time_s: float | None


def find_fork_point(probe: ProbeSource, observations: GoldenObservations) -> ForkPoint | None:
    """Return the point where a mutant leaves the golden run; None if its trigger never holds."""
    return _cached_fork_point(*probe.armed_condition, observations)


@lru_cache(maxsize=64)  # cached, because faults share triggers (contexts of the hazard analysis)
def _cached_fork_point(
    armed_time_s: float, condition: str, observations: GoldenObservations
) -> ForkPoint | None:
    if not observations.values:
        return None
    active_observations = np.flatnonzero(
        is_active_at_observations((armed_time_s, condition), observations.columns)
    )
    if not active_observations.size:
        return None
    step = observations.step_of_observation(int(active_observations[0]))
    observation_count = observations.counts_before_steps[step]
    times = observations.columns[0, :observation_count]
    return ForkPoint(
        step=step,
        observation_count=observation_count,
        # the lowest one, because time starts again if the run restarts
        earliest_time_s=float(times.min()) if observation_count else None,
        last_time_s=float(times[-1]) if observation_count else None,
    )


def is_active_at_observations(armed_condition: tuple[float, str], columns: np.ndarray) -> np.ndarray:
    """Return for each observation whether a probe with this `ProbeSource.armed_condition` is active.

    `columns` are the times (s) of all observations, then the observed values.
    """
    armed_t, condition = armed_condition
    (function,) = ast.parse(condition).body
    assert isinstance(function, ast.FunctionDef)
    names = [argument.arg for argument in function.args.args]
    holds = _evaluate_condition(function, dict(zip(names, columns, strict=True)))
    active: np.ndarray = np.logical_and(columns[0] >= armed_t, holds)
    return active


def _evaluate_condition(function: ast.FunctionDef, values: dict[str, Any]) -> Any:
    """Evaluate a condition for each observation. numpy doubles give the same results as Python floats."""
    with np.errstate(all="ignore"):
        for node in function.body:
            if isinstance(node, ast.Assign):
                assert isinstance(node.targets[0], ast.Name)
                values[node.targets[0].id] = _evaluate_expression(node.value, values)
            elif isinstance(node, ast.Return) and node.value is not None:
                return _evaluate_expression(node.value, values)
    raise AssertionError(ast.unparse(function))


def _evaluate_expression(node: ast.expr, values: Mapping[str, Any]) -> Any:
    def of(node: ast.expr) -> Any:
        return _evaluate_expression(node, values)

    match node:
        case ast.Constant():  # as numpy scalars, because Python's raise on overflow and division by zero
            return np.bool_(node.value) if isinstance(node.value, bool) else np.float64(node.value)  # type: ignore[arg-type]
        case ast.Name():
            return values[node.id]
        case ast.Attribute():  # a condition has no other attribute than `math.inf`
            return np.float64(np.inf)
        case ast.BoolOp():
            return reduce(
                np.logical_and if isinstance(node.op, ast.And) else np.logical_or, map(of, node.values)
            )
        case ast.UnaryOp():
            return np.logical_not(of(node.operand)) if isinstance(node.op, ast.Not) else -of(node.operand)
        case ast.Compare():
            terms = [of(part) for part in (node.left, *node.comparators)]
            return reduce(np.logical_and, map(_compare_values, node.ops, terms[:-1], terms[1:]))
        case ast.IfExp():
            return np.where(of(node.test), of(node.body), of(node.orelse))
        case ast.BinOp():
            return ARITHMETIC_FUNCTIONS[type(node.op)](of(node.left), of(node.right))
        case ast.Call():
            return _FUNCTIONS_BY_NAME[ast.unparse(node.func)](*map(of, node.args))
    raise AssertionError(ast.unparse(node))


def _compare_values(operator: ast.cmpop, left: Any, right: Any) -> Any:
    return COMPARISON_FUNCTIONS[type(operator)](left, right)


def _elementwise_min(*terms: Any) -> Any:
    """Like Python's `min`, also for NaN."""
    return reduce(lambda least, term: np.where(term < least, term, least), terms)


def _elementwise_max(*terms: Any) -> Any:
    return reduce(lambda greatest, term: np.where(term > greatest, term, greatest), terms)


_FUNCTIONS_BY_NAME: Mapping[str, Any] = {
    "abs": np.abs,
    "min": _elementwise_min,
    "max": _elementwise_max,
    "math.hypot": np.vectorize(math.hypot, otypes=[float]),  # numpy's `hypot` differs in the last bit
    "_div": np.divide,
}
