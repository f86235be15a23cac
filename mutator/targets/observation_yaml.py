"""The observation of a manifest."""

import ast
import keyword
from collections.abc import Iterable, Mapping

from pydantic import Field

from mutator._common.message_text import shortened_repr
from mutator.config.location_syntax import PROBE_MODULE_NAME, is_dotted_name
from mutator.config.location_yaml import LocationModel
from mutator.config.unit_symbol_field import UnitSymbol
from mutator.config.yaml_files import StrictModel
from mutator.config.yaml_source_lines import KeyPath, YamlSource
from mutator.model import LOAD_TIME_ANCHORS, VALUE_ANCHORS, FaultLocation
from mutator.targets.confined_relative_paths import clean_relative_path
from mutator.targets.observed_values import Observation, ObservedValue
from mutator.triggers.conditions import RESERVED_NAMES, TIME, canonical_formula

_MOST_LENGTH = 1000  # characters in an expression, at most
# an expression runs in the target at every step, and must not change anything there
_UNCONDITIONALLY_ALLOWED_NODES = (
    *(ast.BinOp, ast.UnaryOp, ast.Compare, ast.Load, ast.operator, ast.unaryop, ast.cmpop),
)
_ALLOWED_CALLS = ("abs", "min", "max", "hypot", "float", "len")
_RESERVED_NAMES = (*RESERVED_NAMES, "math")
_ARGUMENT_COUNTS = {
    "abs": (1, 1),
    "float": (1, 1),
    "len": (1, 1),
    "hypot": (2, 2),
}  # other functions: one or more


class ValueModel(StrictModel, title="A value"):
    is_: str = Field(
        alias="is",
        description="The derived value, as a formula over the values before it; or "
        "the observed value, as an expression at the place.",
    )
    unit: UnitSymbol = Field(
        description="The unit, for tables, as symbol or suffix (`m/s`, `mps`); `-` for none."
    )
    about: str = Field(description="What the value means.")


class ObservationModel(StrictModel, title="The observation"):
    """Where ground truth is read, once in each step. Time must increase from step to step; it may restart
    when another run begins.
    """

    at: LocationModel = Field(description="The place in the source at which the values are read.")
    time: str | None = Field(
        None,
        description="The time in s, as an expression like those of `values`. Without it, the probe counts "
        "steps: the n-th observation is at (n - 1) times `step_s`, and a process cannot "
        "simulate a second run.",
    )
    values: dict[str, ValueModel] = Field(
        default_factory=dict,
        description="Name -> an expression at the place: names, attributes, items with constant keys, "
        "numbers, arithmetic, comparisons, and calls of `abs`, `min`, `max`, `hypot`, `float`, `len`.",
    )
    derived: dict[str, ValueModel] = Field(
        default_factory=dict,
        description="Name -> a formula over the values before it. It may use arithmetic, `abs`, `min`, "
        "`max`, `hypot`, `inf`, and a choice, `a if b > 0 else c`. Division by 0 gives infinity "
        "or NaN, not an error.",
    )


def build_observation(model: ObservationModel, source: YamlSource) -> Observation:
    location = checked_statement_location(model.at, source, ("observation", "at"))
    check_value_names({"values": model.values, "derived": model.derived}, source, "observation")
    time = None if model.time is None else checked_expression(model.time, source, ("observation", "time"))
    values = tuple(
        ObservedValue(
            name=name,
            text=checked_expression(value.is_, source, ("observation", "values", name, "is")),
            unit=value.unit,
            about=value.about,
        )
        for name, value in model.values.items()
    )
    return Observation(
        location=location,
        time=time,
        values=values,
        derived=_build_derived_values(model, source, [TIME, *model.values]),
    )


def checked_statement_location(model: LocationModel, source: YamlSource, keys: KeyPath) -> FaultLocation:
    """Return the location of a statement, at which lines can be inserted; otherwise MutatorError."""
    location = model.build_location(source, keys)
    if location.anchor.kind in VALUE_ANCHORS | LOAD_TIME_ANCHORS:
        raise source.error(
            (*keys, location.anchor.kind.value),
            f"an {keys[0]} at `{location.anchor.kind.value}`",
            expected="a statement, such as `after_assign: gap`",
        )
    with source.locating_errors((*keys, "file")):
        clean_relative_path(location.path)
    return location


def check_value_names(names_by_key: Mapping[str, Iterable[str]], source: YamlSource, section: str) -> None:
    """Check that the names below the keys of a section are identifiers, unreserved and unique."""
    used_names = set[str]()
    for key, names in names_by_key.items():
        for name in names:
            good = name.isidentifier() and not keyword.iskeyword(name) and not name.startswith("_")
            if not good or name in _RESERVED_NAMES or name in used_names:
                raise source.error(
                    (section, key, name),
                    f"'{name}'",
                    expected=f"a unique name of letters, digits and _, none of {', '.join(_RESERVED_NAMES)}",
                    remedy="rename it",
                )
            used_names.add(name)


def _build_derived_values(
    model: ObservationModel, source: YamlSource, names: list[str]
) -> tuple[ObservedValue, ...]:
    values = []
    for name, value in model.derived.items():
        with source.locating_errors(("observation", "derived", name, "is")):
            text = canonical_formula(value.is_, names)
        values.append(ObservedValue(name=name, text=text, unit=value.unit, about=value.about))
        names.append(name)
    return tuple(values)


def checked_expression(text: str, source: YamlSource, keys: KeyPath) -> str:
    """Return the expression in canonical text; MutatorError at `keys` unless it only reads and computes."""
    try:
        return _canonical_expression(text)
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise source.error(
            keys,
            shortened_repr(text),
            expected="names, attributes, items with constant keys, numbers, arithmetic, comparisons, and "
            f"calls of {', '.join(_ALLOWED_CALLS)}",
            remedy="write an expression that gives the value at that statement",
        ) from None


def _canonical_expression(text: str) -> str:
    """Check that an expression only reads and computes; ValueError otherwise."""
    if len(text) > _MOST_LENGTH:
        raise ValueError(text)
    tree = ast.parse(text.strip(), mode="eval").body
    for node in ast.walk(tree):
        if isinstance(node, ast.Call):
            is_allowed = isinstance(node.func, ast.Name) and node.func.id in _ALLOWED_CALLS
            if not is_allowed or node.keywords:
                raise ValueError(text)
            least, most = _ARGUMENT_COUNTS.get(ast.unparse(node.func), (1, _MOST_LENGTH))
            if not least <= len(node.args) <= most:
                raise ValueError(text)
        elif isinstance(node, ast.Subscript):
            _check_constant_key(node.slice, text)
        elif not _is_allowed_node(node):
            raise ValueError(text)
    return ast.unparse(_HypotToProbeRewriter().visit(tree))


def _check_constant_key(node: ast.expr, text: str) -> None:
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        node = node.operand
    if not (isinstance(node, ast.Constant) and type(node.value) in (int, str)):
        raise ValueError(text)


def _is_allowed_node(node: ast.AST) -> bool:
    if isinstance(node, ast.Constant):
        return type(node.value) in (int, float, str)
    if isinstance(node, ast.Name):
        return is_dotted_name(node.id)
    if isinstance(node, ast.Attribute):
        return is_dotted_name(node.attr)
    return isinstance(node, _UNCONDITIONALLY_ALLOWED_NODES)


class _HypotToProbeRewriter(ast.NodeTransformer):
    """Replace `hypot` by the probe's function, because the target's file might not import `hypot`."""

    def visit_Call(self, node: ast.Call) -> ast.AST:
        self.generic_visit(node)
        if isinstance(node.func, ast.Name) and node.func.id == "hypot":
            node.func = ast.Attribute(ast.Name(PROBE_MODULE_NAME, ast.Load()), "hypot", ast.Load())
        return node
