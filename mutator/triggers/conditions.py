"""Conditions over observed ground truth: checked, total, and never more than data.

A condition has one canonical text (`hwt <= 2.0 and rs > 0.0`), which is what ids are made of. All numbers are
floats, and division cannot raise, so a condition is True or False for every observation.
"""

import ast
import math
from collections.abc import Callable, Mapping
from functools import lru_cache

from mutator.errors import MutatorError

VARIABLES = ("t", "d_rel", "v_ego", "v_lead", "hwt", "rs")
_FUNCTIONS = ("abs", "min", "max")
_COMPARE = {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!="}
_ARITHMETIC = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/"}
_MAX_LENGTH = 1000
_ALLOWED = "comparisons, and/or/not, + - * /, abs/min/max, numbers, True, and " + ", ".join(VARIABLES)


def check_condition(text: str, constants: Mapping[str, float] | None = None) -> str:
    """The condition in its one canonical text, constants replaced by their numbers.

    Allowed: the variables, numbers, `True`, comparisons, and/or/not, + - * /, abs/min/max. Anything else
    raises MutatorError (without place: the caller knows file and line).
    """
    try:
        canonical = _Writer(text, constants or {}, divide="({} / {})").boolean(_parse(text))
        _function(canonical)  # what the probe is given must be readable and compile too
    except (SyntaxError, RecursionError, MemoryError):
        raise _refuse("too much in one expression", text, "write it shorter") from None
    return canonical


def to_code(condition: str) -> str:
    """Python source of a checked condition that cannot raise: division goes through the probe's `_div`."""
    return _Writer(condition, {}, divide="_div({}, {})").boolean(_parse(condition))


def evaluate(condition: str, values: Mapping[str, float]) -> bool:
    """What the probe would decide for these values of `VARIABLES` (missing hwt and rs are derived)."""
    known = dict(values)
    if "rs" not in known and {"v_ego", "v_lead"} <= known.keys():
        known["rs"] = known["v_ego"] - known["v_lead"]
    if "hwt" not in known and {"v_ego", "d_rel"} <= known.keys():
        known["hwt"] = known["d_rel"] / known["v_ego"] if known["v_ego"] > 0.0 else math.inf
    arguments = [float(known.get(name, math.nan)) for name in VARIABLES]
    return bool(_function(condition)(*arguments))


def divide(a: float, b: float) -> float:
    """a / b as IEEE 754 has it: infinite or NaN at b = 0, never an exception. The probe has the same."""
    if b:
        return a / b
    return math.nan if a == 0.0 or a != a else math.copysign(math.inf, a) * math.copysign(1.0, b)


@lru_cache(maxsize=256)
def _function(condition: str) -> Callable[..., object]:
    source = f"lambda {', '.join(VARIABLES)}: {to_code(condition)}"
    functions = {"__builtins__": {}, "abs": abs, "min": min, "max": max, "_div": divide}
    return eval(compile(source, "<condition>", "eval"), functions)  # type: ignore[no-any-return]


def _refuse(what: str, condition: str, remedy: str = "rewrite the condition") -> MutatorError:
    return MutatorError(f"{what} in condition {condition!r}", expected=_ALLOWED, remedy=remedy)


def _parse(text: str) -> ast.expr:
    if len(text) > _MAX_LENGTH:
        raise MutatorError(f"a condition of {len(text)} characters", expected=f"at most {_MAX_LENGTH}")
    try:
        return ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        raise _refuse(f"{getattr(error, 'msg', error)}", text) from None


class _Writer:
    """Writes a parsed condition back, refusing whatever is not on the list; booleans and numbers apart."""

    def __init__(self, text: str, constants: Mapping[str, float], divide: str) -> None:
        self.text = text
        self.constants = constants
        self.divide = divide

    def boolean(self, node: ast.expr) -> str:
        if isinstance(node, ast.Constant) and isinstance(node.value, bool):
            return str(node.value)
        if isinstance(node, ast.BoolOp):
            word = " and " if isinstance(node.op, ast.And) else " or "
            return word.join(self._boolean_operand(value) for value in node.values)
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
            return f"not {self._boolean_operand(node.operand)}"
        if isinstance(node, ast.Compare):
            return self._compare(node)
        raise _refuse(
            f"{ast.unparse(node)!r} is no truth value", self.text, "compare it with something: hwt <= 2.0"
        )

    def _boolean_operand(self, node: ast.expr) -> str:
        text = self.boolean(node)
        return f"({text})" if isinstance(node, ast.BoolOp) else text

    def _compare(self, node: ast.Compare) -> str:
        parts = [self._number(node.left)]
        for operator, value in zip(node.ops, node.comparators, strict=True):
            if type(operator) not in _COMPARE:
                raise _refuse(f"{ast.unparse(node)!r}", self.text)
            parts += [_COMPARE[type(operator)], self._number(value)]
        return " ".join(parts)

    def _number(self, node: ast.expr) -> str:
        if isinstance(node, ast.Constant):
            return self._constant(node)
        if isinstance(node, ast.Name):
            return self._name(node.id)
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.UAdd):
            sign = "-" if isinstance(node.op, ast.USub) else ""
            return f"{sign}{self._number(node.operand)}"
        if isinstance(node, ast.BinOp) and type(node.op) in _ARITHMETIC:
            left, right = self._number(node.left), self._number(node.right)
            if isinstance(node.op, ast.Div):
                return self.divide.format(left, right)
            return f"({left} {_ARITHMETIC[type(node.op)]} {right})"
        if isinstance(node, ast.Call):
            return self._call(node)
        raise _refuse(f"{ast.unparse(node)!r}", self.text)

    def _constant(self, node: ast.Constant) -> str:
        if isinstance(node.value, bool) or not isinstance(node.value, int | float):
            raise _refuse(f"{node.value!r}", self.text)
        try:
            number = float(node.value)
        except OverflowError:
            number = math.inf
        if not math.isfinite(number):
            raise _refuse("a number too large", self.text)
        return repr(number)

    def _name(self, name: str) -> str:
        if name in VARIABLES:
            return name
        if name in self.constants:
            return repr(float(self.constants[name]))
        remedy = (
            f"known constants here: {', '.join(self.constants)}" if self.constants else "check its spelling"
        )
        raise _refuse(f"unknown name '{name}'", self.text, remedy)

    def _call(self, node: ast.Call) -> str:
        name = node.func.id if isinstance(node.func, ast.Name) else ast.unparse(node.func)
        if name not in _FUNCTIONS or node.keywords or any(isinstance(a, ast.Starred) for a in node.args):
            raise _refuse(f"a call of '{name}'", self.text)
        if (len(node.args) != 1) if name == "abs" else (len(node.args) < 2):
            raise _refuse(f"{name} with {len(node.args)} arguments", self.text)
        return f"{name}({', '.join(self._number(a) for a in node.args)})"
