"""Evaluate conditions and formulas at each step of a whole trace."""

import ast
from collections.abc import Mapping
from functools import reduce
from typing import Any

import numpy as np

from mutator.triggers.conditions import TIME, parse_expression

COMPARISON_FUNCTIONS: Mapping[type[ast.cmpop], np.ufunc] = {
    ast.Lt: np.less,
    ast.LtE: np.less_equal,
    ast.Gt: np.greater,
    ast.GtE: np.greater_equal,
    ast.Eq: np.equal,
    ast.NotEq: np.not_equal,
}
ARITHMETIC_FUNCTIONS: Mapping[type[ast.operator], np.ufunc] = {
    ast.Add: np.add,
    ast.Sub: np.subtract,
    ast.Mult: np.multiply,
    ast.Div: np.divide,
}
_NUMPY_FUNCTIONS: Mapping[str, np.ufunc] = {"abs": np.abs, "hypot": np.hypot}
_FUNCTIONS_OF_MANY: Mapping[str, np.ufunc] = {"min": np.minimum, "max": np.maximum}


def condition_at_each_step(condition: str, values: Mapping[str, np.ndarray]) -> np.ndarray:
    """Return for each step whether a checked condition holds. `values` includes the time (s)."""
    with np.errstate(all="ignore"):  # inf and NaN are values here, as in the probe
        return _repeated_for_each_step(
            _TraceEvaluation(values).evaluate_boolean(parse_expression(condition)), values
        )


def formula_at_each_step(formula: str, values: Mapping[str, np.ndarray]) -> np.ndarray:
    """Return a checked formula's value for each step. Division by 0 is infinite or NaN, as in the probe."""
    with np.errstate(all="ignore"):
        return _repeated_for_each_step(
            _TraceEvaluation(values).evaluate_number(parse_expression(formula)), values
        )


def _repeated_for_each_step(result: Any, values: Mapping[str, np.ndarray]) -> np.ndarray:
    shape = values[TIME].shape
    return result if np.shape(result) == shape else np.full(shape, result)


class _TraceEvaluation:
    """Evaluates a checked expression; each value is an array with an entry per step, or one value for all."""

    def __init__(self, values: Mapping[str, np.ndarray]) -> None:
        self._values = values
        self._time = values[TIME]

    def evaluate_boolean(self, node: ast.expr) -> Any:
        if isinstance(node, ast.Constant):
            return np.bool_(node.value)
        if isinstance(node, ast.BoolOp):
            both = np.logical_and if isinstance(node.op, ast.And) else np.logical_or
            return reduce(both, map(self.evaluate_boolean, node.values))
        if isinstance(node, ast.UnaryOp):
            return np.logical_not(self.evaluate_boolean(node.operand))
        if isinstance(node, ast.Call):  # ever
            condition = _repeated_for_each_step(self.evaluate_boolean(node.args[0]), self._values)
            return np.logical_or.accumulate(condition)
        assert isinstance(node, ast.Compare)
        terms = [self.evaluate_number(part) for part in (node.left, *node.comparators)]
        comparisons = [COMPARISON_FUNCTIONS[type(op)](*terms[i : i + 2]) for i, op in enumerate(node.ops)]
        return reduce(np.logical_and, comparisons)

    def evaluate_number(self, node: ast.expr) -> Any:
        if isinstance(node, ast.Constant):
            return np.float64(node.value)  # type: ignore[arg-type]
        if isinstance(node, ast.Name):
            return np.float64(np.inf) if node.id == "inf" else self._values[node.id]
        if isinstance(node, ast.UnaryOp):
            operand = self.evaluate_number(node.operand)
            return -operand if isinstance(node.op, ast.USub) else operand
        if isinstance(node, ast.BinOp):
            return ARITHMETIC_FUNCTIONS[type(node.op)](
                self.evaluate_number(node.left), self.evaluate_number(node.right)
            )
        if isinstance(node, ast.IfExp):
            return np.where(
                self.evaluate_boolean(node.test),
                self.evaluate_number(node.body),
                self.evaluate_number(node.orelse),
            )
        assert isinstance(node, ast.Call)
        return self._evaluate_call(node, [self.evaluate_number(argument) for argument in node.args])

    def _evaluate_call(self, node: ast.Call, arguments: list[Any]) -> Any:
        assert isinstance(node.func, ast.Name)
        name = node.func.id
        if name in _FUNCTIONS_OF_MANY:
            return reduce(_FUNCTIONS_OF_MANY[name], arguments)
        if name == "rate":
            values = _repeated_for_each_step(arguments[0], self._values)
            # the first step has no earlier one, and a comparison with NaN is false
            return np.concatenate(([np.nan], np.diff(values) / np.diff(self._time)))[: len(values)]
        return _NUMPY_FUNCTIONS[name](*arguments)
