"""Evaluate conditions and formulas at each step of a whole trace."""

import ast
from collections.abc import Callable, Mapping
from functools import lru_cache, reduce
from typing import Any

import numpy as np

from mutator.triggers.conditions import TIME, parse_expression

ValuesByName = Mapping[str, np.ndarray]
Evaluate = Callable[[ValuesByName], Any]  # an array with an entry per step, or one value for all

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


def condition_at_each_step(condition: str, values: ValuesByName) -> np.ndarray:
    """Return for each step whether a checked condition holds. `values` includes the time (s)."""
    with np.errstate(all="ignore"):  # inf and NaN are values here, as in the probe
        return _repeated_for_each_step(_condition_evaluation(condition)(values), values)


def formula_at_each_step(formula: str, values: ValuesByName) -> np.ndarray:
    """Return a checked formula's value for each step. Division by 0 is infinite or NaN, as in the probe."""
    with np.errstate(all="ignore"):
        return _repeated_for_each_step(_formula_evaluation(formula)(values), values)


def _repeated_for_each_step(result: Any, values: ValuesByName) -> np.ndarray:
    shape = values[TIME].shape
    return result if np.shape(result) == shape else np.full(shape, result)


@lru_cache(maxsize=1024)  # a manifest has a few dozen, and evaluates them for each run
def _condition_evaluation(condition: str) -> Evaluate:
    return _boolean(parse_expression(condition))


@lru_cache(maxsize=1024)
def _formula_evaluation(formula: str) -> Evaluate:
    return _number(parse_expression(formula))


def _boolean(node: ast.expr) -> Evaluate:
    if isinstance(node, ast.Constant):
        constant = np.bool_(node.value)
        return lambda values: constant
    if isinstance(node, ast.BoolOp):
        both = np.logical_and if isinstance(node.op, ast.And) else np.logical_or
        return _reduced(both, list(map(_boolean, node.values)))
    if isinstance(node, ast.UnaryOp):
        operand = _boolean(node.operand)
        return lambda values: np.logical_not(operand(values))
    if isinstance(node, ast.Call):  # ever
        condition = _boolean(node.args[0])
        return lambda values: np.logical_or.accumulate(_repeated_for_each_step(condition(values), values))
    assert isinstance(node, ast.Compare)
    terms = [_number(part) for part in (node.left, *node.comparators)]
    comparisons = zip((COMPARISON_FUNCTIONS[type(op)] for op in node.ops), terms, terms[1:], strict=False)
    return _reduced(np.logical_and, [_applied(*comparison) for comparison in comparisons])


def _number(node: ast.expr) -> Evaluate:
    if isinstance(node, ast.Constant):
        constant = np.float64(node.value)  # type: ignore[arg-type]
        return lambda values: constant
    if isinstance(node, ast.Name):
        name = node.id
        return (lambda values: np.float64(np.inf)) if name == "inf" else (lambda values: values[name])
    if isinstance(node, ast.UnaryOp):
        operand = _number(node.operand)
        return (lambda values: -operand(values)) if isinstance(node.op, ast.USub) else operand
    if isinstance(node, ast.BinOp):
        return _applied(ARITHMETIC_FUNCTIONS[type(node.op)], _number(node.left), _number(node.right))
    if isinstance(node, ast.IfExp):
        return _applied(np.where, _boolean(node.test), _number(node.body), _number(node.orelse))
    assert isinstance(node, ast.Call)
    assert isinstance(node.func, ast.Name)
    arguments = list(map(_number, node.args))
    if node.func.id in _FUNCTIONS_OF_MANY:
        return _reduced(_FUNCTIONS_OF_MANY[node.func.id], arguments)
    if node.func.id == "rate":
        return _rate(arguments[0])
    return _applied(_NUMPY_FUNCTIONS[node.func.id], *arguments)


def _applied(function: Callable[..., Any], *arguments: Evaluate) -> Evaluate:
    return lambda values: function(*[argument(values) for argument in arguments])


def _reduced(function: np.ufunc, arguments: list[Evaluate]) -> Evaluate:
    return lambda values: reduce(function, [argument(values) for argument in arguments])


def _rate(argument: Evaluate) -> Evaluate:
    def rate(values: ValuesByName) -> Any:
        numbers = _repeated_for_each_step(argument(values), values)
        # the first step has no earlier one, and a comparison with NaN is false
        return np.concatenate(([np.nan], np.diff(numbers) / np.diff(values[TIME])))[: len(numbers)]

    return rate
