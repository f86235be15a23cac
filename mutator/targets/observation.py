"""What is observed of a target: values read at one place in each step, and values derived from them."""

import ast
import keyword
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property

from pydantic import Field

from mutator._common.text import shown
from mutator.config.locations import PROBE_NAME, AtModel, dotted_name
from mutator.config.yaml_files import Source, StrictModel
from mutator.model import FIXED_ANCHORS, VALUE_ANCHORS, FaultLocation
from mutator.targets.paths import inside
from mutator.triggers.conditions import RESERVED, TIME, check_formula, names_in

_LONGEST = 1000  # characters in an expression, at most
_READING = (
    *(ast.BinOp, ast.UnaryOp, ast.Compare, ast.Load, ast.Subscript, ast.Call),
    *(ast.operator, ast.unaryop, ast.cmpop),
)
_FUNCTIONS = ("abs", "min", "max", "hypot", "float", "len")
_TAKEN = (*RESERVED, "math")
_ARGUMENTS = {"abs": (1, 1), "float": (1, 1), "len": (1, 1), "hypot": (2, 2)}  # other functions: one or more


@dataclass(frozen=True, slots=True, kw_only=True)
class Value:
    """An observed value. `text` is an expression at the place; for a derived value it is a formula over
    earlier values.
    """

    name: str
    text: str
    unit: str
    about: str


@dataclass(frozen=True, kw_only=True)
class Observation:
    """Where a target is observed. `time` is an expression for the time (s); if it is None, the probe counts
    steps.
    """

    location: FaultLocation
    time: str | None
    values: tuple[Value, ...]
    derived: tuple[Value, ...]

    @property
    def expressions(self) -> tuple[tuple[str, str], ...]:
        time = () if self.time is None else ((TIME, self.time),)
        return (*time, *((value.name, value.text) for value in self.values))

    @cached_property
    def variables(self) -> tuple[str, ...]:
        """The names for conditions: the time, the observed values and the derived values."""
        return (TIME, *(value.name for value in (*self.values, *self.derived)))

    def inputs(self, names: Iterable[str]) -> frozenset[str]:
        """Return these names, and the inputs of those that are derived values."""
        found = set(names)
        for value in reversed(self.derived):
            if value.name in found:
                found.update(names_in(value.text))
        return frozenset(found)

    def judgeable(self, channels: Iterable[str]) -> tuple[str, ...]:
        """Return the names that formulas over a trace with these channels can use: time, channels, and values
        derived from them.
        """
        known = dict.fromkeys((TIME, *(name for name in channels if name.isidentifier())))
        for value in self.derived:
            if all(name in known for name in names_in(value.text)):
                known[value.name] = None
        return tuple(known)


class _ValueModel(StrictModel, title="A value"):
    is_: str = Field(
        alias="is",
        description="The derived value, as a formula over the values before it; or "
        "the observed value, as an expression at the place.",
    )
    unit: str = Field(description="The unit, for tables; `-` for none.")
    about: str = Field(description="What the value means.")


class ObservationModel(StrictModel, title="The observation"):
    """Where ground truth is read, once in each step. Time must increase from step to step; it may restart
    when another run begins.
    """

    at: AtModel = Field(description="The place in the source at which the values are read.")
    time: str | None = Field(
        None,
        description="The time in s, as an expression like those of `values`. Without it, the probe counts "
        "steps: the n-th observation is at (n - 1) times `step_s`, and a process cannot "
        "simulate a second run.",
    )
    values: dict[str, _ValueModel] = Field(
        default_factory=dict,
        description="Name -> an expression at the place: names, attributes, items with constant keys, "
        "numbers, arithmetic, comparisons, and calls of `abs`, `min`, `max`, `hypot`, `float`, `len`.",
    )
    derived: dict[str, _ValueModel] = Field(
        default_factory=dict,
        description="Name -> a formula over the values before it. It may use arithmetic, `abs`, `min`, "
        "`max`, `hypot`, `inf`, and a choice, `a if b > 0 else c`. Division by 0 gives infinity "
        "or NaN, not an error.",
    )


def read_observation(model: ObservationModel, source: Source) -> Observation:
    location = model.at.location(source, ("observation", "at"))
    if location.anchor.kind in VALUE_ANCHORS | FIXED_ANCHORS:
        raise source.error(
            ("observation", "at", location.anchor.kind.value),
            f"an observation at `{location.anchor.kind.value}`",
            expected="a statement, such as `after_assign: gap`",
        )
    with source.placing(("observation", "at", "file")):
        inside(location.path)
    _check_names(model, source)
    time = None if model.time is None else _read(model.time, source, ("observation", "time"))
    values = tuple(
        Value(
            name=name,
            text=_read(value.is_, source, ("observation", "values", name, "is")),
            unit=value.unit,
            about=value.about,
        )
        for name, value in model.values.items()
    )
    return Observation(
        location=location, time=time, values=values, derived=_derived(model, source, [TIME, *model.values])
    )


def _check_names(model: ObservationModel, source: Source) -> None:
    for key, names in (("values", model.values), ("derived", model.derived)):
        for name in names:
            good = name.isidentifier() and not keyword.iskeyword(name) and not name.startswith("_")
            if not good or name in _TAKEN or (key == "derived" and name in model.values):
                raise source.error(
                    ("observation", key, name),
                    f"'{name}'",
                    expected=f"a unique name of letters, digits and _, none of {', '.join(_TAKEN)}",
                    remedy="rename it",
                )


def _derived(model: ObservationModel, source: Source, known: list[str]) -> tuple[Value, ...]:
    found = []
    for name, value in model.derived.items():
        with source.placing(("observation", "derived", name, "is")):
            text = check_formula(value.is_, known)
        found.append(Value(name=name, text=text, unit=value.unit, about=value.about))
        known.append(name)
    return tuple(found)


def _read(text: str, source: Source, keys: tuple[str, ...]) -> str:
    try:
        return _expression(text)
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise source.error(
            keys,
            shown(text),
            expected="names, attributes, items with constant keys, numbers, arithmetic, comparisons, and "
            f"calls of {', '.join(_FUNCTIONS)}",
            remedy="write an expression that gives the value at that statement",
        ) from None


def _expression(text: str) -> str:
    """Check that an expression only reads and computes; ValueError otherwise."""
    if len(text) > _LONGEST:
        raise ValueError(text)
    tree = ast.parse(text.strip(), mode="eval").body
    for node in ast.walk(tree):
        if isinstance(node, ast.Call):
            known = isinstance(node.func, ast.Name) and node.func.id in _FUNCTIONS
            if not known or node.keywords:
                raise ValueError(text)
            least, most = _ARGUMENTS.get(ast.unparse(node.func), (1, _LONGEST))
            if not least <= len(node.args) <= most:
                raise ValueError(text)
        elif isinstance(node, ast.Subscript):
            _check_constant(node.slice, text)
        elif not _is_plain(node):
            raise ValueError(text)
    return ast.unparse(_Hypot().visit(tree))


def _check_constant(node: ast.expr, text: str) -> None:
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        node = node.operand
    if not (isinstance(node, ast.Constant) and type(node.value) in (int, str)):
        raise ValueError(text)


def _is_plain(node: ast.AST) -> bool:
    if isinstance(node, ast.Constant):
        return type(node.value) in (int, float, str)
    if isinstance(node, ast.Name):
        return dotted_name(node.id)
    if isinstance(node, ast.Attribute):
        return dotted_name(node.attr)
    return isinstance(node, _READING)


class _Hypot(ast.NodeTransformer):
    """Replace `hypot` by the probe's function, because the target's file might not import `hypot`."""

    def visit_Call(self, node: ast.Call) -> ast.AST:
        self.generic_visit(node)
        if isinstance(node.func, ast.Name) and node.func.id == "hypot":
            node.func = ast.Attribute(ast.Name(PROBE_NAME, ast.Load()), "hypot", ast.Load())
        return node


def variable_units(observation: Observation) -> Mapping[str, tuple[str, str]]:
    """Return the unit and meaning of every name in conditions."""
    values = (*observation.values, *observation.derived)
    return {TIME: ("s", "time"), **{value.name: (value.unit, value.about) for value in values}}
