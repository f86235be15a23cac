"""Conditions and formulas over a whole trace: a truth value or a number for each of its steps."""

import ast
from collections.abc import Mapping

import numpy as np

from mutator.triggers.conditions import TIME, parse

_COMPARE: Mapping[type[ast.cmpop], np.ufunc] = {
    ast.Lt: np.less,
    ast.LtE: np.less_equal,
    ast.Gt: np.greater,
    ast.GtE: np.greater_equal,
    ast.Eq: np.equal,
    ast.NotEq: np.not_equal,
}
_ARITHMETIC: Mapping[type[ast.operator], np.ufunc] = {
    ast.Add: np.add,
    ast.Sub: np.subtract,
    ast.Mult: np.multiply,
    ast.Div: np.divide,
}
_FUNCTIONS: Mapping[str, np.ufunc] = {"abs": np.abs, "hypot": np.hypot}
_OF_MANY: Mapping[str, np.ufunc] = {"min": np.minimum, "max": np.maximum}


def holds(condition: str, values: Mapping[str, np.ndarray]) -> np.ndarray:
    """Whether a checked condition holds, for each step; `values` has the variables, time (s) among them."""
    return _Evaluation(values).boolean(parse(condition))


def numbers(formula: str, values: Mapping[str, np.ndarray]) -> np.ndarray:
    """What a checked formula gives, for each step. Division by 0 is infinite or NaN, as the probe has it."""
    return _Evaluation(values).number(parse(formula))


class _Evaluation:
    """Walks a checked expression; everything in it is an array with a value for each step."""

    def __init__(self, values: Mapping[str, np.ndarray]) -> None:
        self._values = values
        self._time = values[TIME]

    def boolean(self, node: ast.expr) -> np.ndarray:
        if isinstance(node, ast.Constant):
            return np.full(self._time.shape, bool(node.value))
        if isinstance(node, ast.BoolOp):
            both = np.logical_and if isinstance(node.op, ast.And) else np.logical_or
            return np.asarray(both.reduce([self.boolean(value) for value in node.values]))
        if isinstance(node, ast.UnaryOp):
            return np.asarray(np.logical_not(self.boolean(node.operand)))
        if isinstance(node, ast.Call):  # ever
            return np.asarray(np.logical_or.accumulate(self.boolean(node.args[0])))
        assert isinstance(node, ast.Compare)
        terms = [self.number(part) for part in (node.left, *node.comparators)]
        found = [_COMPARE[type(op)](*terms[i : i + 2]) for i, op in enumerate(node.ops)]
        return np.asarray(np.logical_and.reduce(found))

    def number(self, node: ast.expr) -> np.ndarray:
        with np.errstate(all="ignore"):
            return self._number(node)

    def _number(self, node: ast.expr) -> np.ndarray:
        if isinstance(node, ast.Constant):
            return np.full(self._time.shape, float(node.value))  # type: ignore[arg-type]
        if isinstance(node, ast.Name):
            return np.full(self._time.shape, np.inf) if node.id == "inf" else self._values[node.id]
        if isinstance(node, ast.UnaryOp):
            operand = self.number(node.operand)
            return -operand if isinstance(node.op, ast.USub) else operand
        if isinstance(node, ast.BinOp):
            return np.asarray(_ARITHMETIC[type(node.op)](self.number(node.left), self.number(node.right)))
        if isinstance(node, ast.IfExp):
            return np.where(self.boolean(node.test), self.number(node.body), self.number(node.orelse))
        assert isinstance(node, ast.Call)
        return self._call(ast.unparse(node.func), [self.number(argument) for argument in node.args])

    def _call(self, name: str, arguments: list[np.ndarray]) -> np.ndarray:
        if name in _OF_MANY:
            return np.asarray(_OF_MANY[name].reduce(arguments))
        if name == "rate":
            (values,) = arguments
            return np.concatenate(([np.nan], np.diff(values) / np.diff(self._time)))[: len(values)]
        return np.asarray(_FUNCTIONS[name](*arguments))
