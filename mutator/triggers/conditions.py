"""Conditions and formulas over observed values: check, convert and evaluate them.

Ids are made from a condition's canonical text (`gap <= 2.0 and closing > 0.0`). All numbers are floats and
division cannot raise, so a condition is True or False for every observation. A formula yields a number; it
can also contain choices (`a / b if b > 0 else inf`).
"""

import ast
import math
from collections.abc import Callable, Collection, Mapping
from functools import lru_cache

from mutator._common.message_text import counted, python_operator_hint, spelling_suggestion
from mutator.errors import MutatorError

TIME = "t"  # s; every target has it
GOLDEN_PREFIX = "golden."  # before a name: its value in the golden run
_ALLOWED_FUNCTIONS = ("abs", "min", "max", "hypot")
_FUNCTIONS_OVER_TIME = ("ever", "rate")  # whether a condition has held so far; a number's change per second
# minimum and maximum; other functions take two or more
_ARGUMENT_COUNTS = {"abs": (1, 1), "hypot": (2, 2), "rate": (1, 1)}
_BUILT_IN_NAMES = (*_ALLOWED_FUNCTIONS, *_FUNCTIONS_OVER_TIME, "inf", "True", "False")  # not variables
_COMPARISON_SIGNS = {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!="}
_ARITHMETIC_SIGNS = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/"}
# names in formulas that are not the target's values
RESERVED_NAMES = (*_ALLOWED_FUNCTIONS, *_FUNCTIONS_OVER_TIME, "inf", TIME)
_MOST_LENGTH = 1000  # characters; bounds what a hostile condition costs Python's parser
_ALLOWED_SYNTAX = "comparisons, and/or/not, + - * /, abs/min/max/hypot, numbers, True, and "


def canonical_condition(
    text: str,
    constants: Mapping[str, float] | None = None,
    variables: Collection[str] | None = None,
    *,
    over_time: bool = False,
) -> str:
    """Check a condition and return its canonical text, with constants replaced by their numbers.

    Allowed: the variables (None: any name, checked once the target is known), numbers, `True`, comparisons,
    and/or/not, + - * /, abs/min/max/hypot, and, with `over_time`, `ever` of a condition and `rate` of a
    number, which need a whole trace. Anything else raises MutatorError without file and line, which the
    caller adds.
    """
    return _canonical_text(text, constants or {}, variables, number=False, over_time=over_time)


def canonical_formula(text: str, variables: Collection[str], *, over_time: bool = False) -> str:
    """Check a formula and return its canonical text; errors as in `canonical_condition`.

    Allowed: everything that `canonical_condition` allows inside a comparison, `inf`, and `a if CONDITION else
    b`.
    """
    return _canonical_text(text, {}, variables, number=True, over_time=over_time)


def _canonical_text(
    text: str,
    constants: Mapping[str, float],
    variables: Collection[str] | None,
    *,
    number: bool,
    over_time: bool,
) -> str:
    try:
        writer = _ExpressionWriter(text, constants, variables, divide="({} / {})", over_time=over_time)
        canonical = (
            writer.write_number(parse_expression(text))
            if number
            else writer.write_boolean(parse_expression(text))
        )
        # the probe must be able to compile it, too
        if over_time:
            compile(canonical, "<condition>", "eval")
        else:
            _compile_function(canonical, names_in(canonical), number)
    except (SyntaxError, RecursionError, MemoryError):
        raise _syntax_error("too many nested operations", text, variables, "simplify it") from None
    return canonical


@lru_cache(maxsize=1024)
def names_in(text: str) -> tuple[str, ...]:
    nodes = (node for node in ast.walk(parse_expression(text)) if isinstance(node, ast.Name))
    ordered = sorted(nodes, key=lambda node: (node.lineno, node.col_offset))
    return tuple(dict.fromkeys(node.id for node in ordered if node.id not in _BUILT_IN_NAMES))


def to_python_source(
    text: str, constants: Mapping[str, float] | None = None, *, is_formula: bool = False
) -> str:
    """Convert a checked condition or formula to Python that cannot raise and uses `_div` and `math`.

    With `constants`, which replace their names, a division by a constant that is not 0 needs no `_div`.
    """
    writer = _ExpressionWriter(
        text,
        constants or {},
        None,
        divide="_div({}, {})",
        divide_by_constant=None if constants is None else "({} / {})",
        infinity="math.inf",
        hypot="math.hypot",
    )
    return (
        writer.write_number(parse_expression(text))
        if is_formula
        else writer.write_boolean(parse_expression(text))
    )


def evaluate_condition(condition: str, values: Mapping[str, float]) -> bool:
    """Evaluate a condition as the probe does; missing values are NaN."""
    names = names_in(condition)
    return bool(
        _compile_function(condition, names, False)(*(float(values.get(name, math.nan)) for name in names))
    )


def divide(a: float, b: float) -> float:
    """Divide as IEEE 754 does: infinite or NaN for b = 0. The probe contains the same function."""
    if b:
        return a / b
    # the sign of a zero counts: 1 / -0.0 is -inf
    return math.nan if a == 0.0 or a != a else math.copysign(math.inf, a) * math.copysign(1.0, b)


@lru_cache(maxsize=256)
def _compile_function(text: str, names: tuple[str, ...], number: bool) -> Callable[..., object]:
    source = f"lambda {', '.join(names)}: {to_python_source(text, is_formula=number)}"
    functions = {"__builtins__": {}, "abs": abs, "min": min, "max": max, "math": math, "_div": divide}
    return eval(compile(source, "<condition>", "eval"), functions)  # type: ignore[no-any-return]


def _syntax_error(
    what: str, text: str, variables: Collection[str] | None, remedy: str = "rewrite it"
) -> MutatorError:
    allowed = "the target's observed values" if variables is None else ", ".join(variables)
    return MutatorError(f"{what} in {text!r}", expected=_ALLOWED_SYNTAX + allowed, remedy=remedy)


@lru_cache(maxsize=1024)  # a manifest's conditions are parsed for each run that is judged
def parse_expression(text: str) -> ast.expr:
    """Parse a condition or formula into a tree that must not be changed; MutatorError for bad syntax."""
    if len(text) > _MOST_LENGTH:
        raise MutatorError(f"a condition of {len(text)} characters", expected=f"at most {_MOST_LENGTH}")
    try:
        tree = ast.parse(text.strip(), mode="eval").body
        return _GoldenNameJoiner().visit(tree) if GOLDEN_PREFIX in text else tree
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        hint = python_operator_hint(text) or "rewrite it"
        raise _syntax_error(f"{getattr(error, 'msg', error)}", text, None, hint) from None


def _is_nonzero_constant(node: ast.expr, constants: Mapping[str, float]) -> bool:
    """Whether an expression is a number or a constant, with or without a sign, and not 0."""
    match node:
        case ast.Constant(value=int() | float() as value):
            return bool(value)
        case ast.Name(id=name):
            return bool(constants.get(name))
        case ast.UnaryOp(operand=operand):
            return _is_nonzero_constant(operand, constants)
        case _:
            return False


class _GoldenNameJoiner(ast.NodeTransformer):
    """Turns `golden.gap` into one name."""

    def visit_Attribute(self, node: ast.Attribute) -> ast.expr:
        name = ast.unparse(node)
        return ast.copy_location(ast.Name(name, ast.Load()), node) if name.startswith(GOLDEN_PREFIX) else node


class _ExpressionWriter:
    """Writes a parsed condition as text.

    It rejects everything that is not allowed, booleans used as numbers, and numbers used as booleans.
    """

    def __init__(
        self,
        text: str,
        constants: Mapping[str, float],
        variables: Collection[str] | None,
        *,
        divide: str,
        divide_by_constant: str | None = None,
        infinity: str = "inf",
        hypot: str = "hypot",
        over_time: bool = False,
    ) -> None:
        self.text = text
        self.constants = constants
        self.variables = variables
        self.division_format = divide
        self.constant_division_format = divide_by_constant or divide
        self.replacements = {"inf": infinity, "hypot": hypot}
        self.over_time = over_time

    def write_boolean(self, node: ast.expr) -> str:
        if isinstance(node, ast.Constant) and isinstance(node.value, bool):
            return str(node.value)
        if isinstance(node, ast.BoolOp):
            word = " and " if isinstance(node.op, ast.And) else " or "
            return word.join(self._write_boolean_operand(value) for value in node.values)
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
            return f"not {self._write_boolean_operand(node.operand)}"
        if isinstance(node, ast.Compare):
            return self._write_comparison(node)
        if isinstance(node, ast.Call) and self.over_time and ast.unparse(node.func) == "ever":
            if len(node.args) != 1 or node.keywords:
                raise self._error_in_text(f"{ast.unparse(node)!r}", "write ever(CONDITION)")
            return f"ever({self.write_boolean(node.args[0])})"
        raise self._error_in_text(
            f"{ast.unparse(node)!r} is not a truth value", "compare it with a value, e.g. t <= 2.0"
        )

    def write_number(self, node: ast.expr) -> str:
        if isinstance(node, ast.IfExp):
            value, test = self._write_term(node.body), self.write_boolean(node.test)
            return f"{value} if {test} else {self.write_number(node.orelse)}"
        return self._write_term(node)

    def _write_boolean_operand(self, node: ast.expr) -> str:
        text = self.write_boolean(node)
        return f"({text})" if isinstance(node, ast.BoolOp) else text

    def _write_comparison(self, node: ast.Compare) -> str:
        parts = [self._write_term(node.left)]
        for operator, value in zip(node.ops, node.comparators, strict=True):
            if type(operator) not in _COMPARISON_SIGNS:
                raise self._error_in_text(f"{ast.unparse(node)!r}")
            parts += [_COMPARISON_SIGNS[type(operator)], self._write_term(value)]
        return " ".join(parts)

    def _write_term(self, node: ast.expr) -> str:
        if isinstance(node, ast.Constant):
            return self._write_constant(node)
        if isinstance(node, ast.Name):
            return self._write_name(node.id)
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.UAdd):
            sign = "-" if isinstance(node.op, ast.USub) else ""
            return f"{sign}{self._write_term(node.operand)}"
        if isinstance(node, ast.BinOp) and type(node.op) in _ARITHMETIC_SIGNS:
            left, right = self._write_term(node.left), self._write_term(node.right)
            if isinstance(node.op, ast.Div):
                is_constant = _is_nonzero_constant(node.right, self.constants)
                return (self.constant_division_format if is_constant else self.division_format).format(
                    left, right
                )
            return f"({left} {_ARITHMETIC_SIGNS[type(node.op)]} {right})"
        if isinstance(node, ast.Call):
            return self._write_call(node)
        raise self._error_in_text(f"{ast.unparse(node)!r}")

    def _write_constant(self, node: ast.Constant) -> str:
        if isinstance(node.value, bool) or not isinstance(node.value, int | float):
            raise self._error_in_text(f"{node.value!r}")
        try:
            number = float(node.value)
        except OverflowError:  # an integer of more than 308 digits
            number = math.inf
        if not math.isfinite(number):
            raise self._error_in_text("a number that is too large")
        return repr(number)

    def _write_name(self, name: str) -> str:
        if name in self.constants:
            return repr(float(self.constants[name]))
        if name == "inf":
            return self.replacements["inf"]
        if name not in _BUILT_IN_NAMES and (
            GOLDEN_PREFIX not in name if self.variables is None else name in self.variables
        ):
            return name
        names = [*self.constants, *(self.variables or ())]
        remedy = (
            f"the known constants are {', '.join(self.constants)}" if self.constants else "check its spelling"
        ) + spelling_suggestion(name, names)
        raise self._error_in_text(f"unknown name '{name}'", remedy)

    def _write_call(self, node: ast.Call) -> str:
        name = node.func.id if isinstance(node.func, ast.Name) else ast.unparse(node.func)
        allowed = (*_ALLOWED_FUNCTIONS, "rate") if self.over_time else _ALLOWED_FUNCTIONS
        if name not in allowed or node.keywords or any(isinstance(a, ast.Starred) for a in node.args):
            raise self._error_in_text(f"a call of '{name}'")
        least, most = _ARGUMENT_COUNTS.get(name, (2, math.inf))
        if not least <= len(node.args) <= most:
            raise self._error_in_text(f"{name} with {counted(len(node.args), 'argument')}")
        return f"{self.replacements.get(name, name)}({', '.join(self._write_term(a) for a in node.args)})"

    def _error_in_text(self, what: str, remedy: str = "rewrite it") -> MutatorError:
        return _syntax_error(what, self.text, self.variables, remedy)
