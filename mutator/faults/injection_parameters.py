"""Check an injection's parameters and convert them from the spec's form to the template's."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from mutator._common.message_text import describe_choices, shortened_repr, spelling_suggestion
from mutator._common.random_streams import random_generator
from mutator.config import units
from mutator.config.location_syntax import is_assignable, is_dotted_name, is_message_expression
from mutator.config.yaml_source_lines import YamlSource
from mutator.errors import MutatorError
from mutator.faults.draw_specs import DrawSpec
from mutator.faults.fault_models import NAME_PARAM_TYPES, UNIT_OF_CHANGED_VARIABLE, FaultModel, ParamSchema
from mutator.faults.injection_specs import (
    DrawReference,
    InjectionSpec,
    ParamSpec,
    convert_drawn_value,
    parse_draw_reference,
)
from mutator.model import LOAD_TIME_ANCHORS, VALUE_ANCHORS, AnchorKind, Injection, Value

_EXPECTED_BY_NAME_TYPE = {
    "variable": "a name as in the source",
    "import": "a module of the target and a name in it",
}
_MOST_INTEGER_EXACT_AS_FLOAT = 2**53  # every integer up to this is exact as a double
_ANCHOR_KINDS_WITHOUT_TARGET = VALUE_ANCHORS | LOAD_TIME_ANCHORS
_ANCHOR_KINDS_WITH_DEFAULT_TARGET = (AnchorKind.AFTER_ASSIGN, AnchorKind.BEFORE_ASSIGN)


@dataclass(frozen=True, slots=True)
class DrawnValue:
    """A value, and the draw that it comes from."""

    draw: DrawSpec
    value: float | int


def resolve_injection(
    spec: InjectionSpec,
    model: FaultModel,
    source: YamlSource,
    *,
    drawn_values: Sequence[DrawnValue] = (),
    seed: int = 0,
    key: str = "",
) -> Injection:
    """Insert the drawn values of one fault, and return the injection.

    Parameters are sorted by name, and numbers are in the unit that the template expects. A missing `target`
    defaults to the name that the anchor assigns. A `seed` parameter is drawn from (seed, key). MutatorError
    with file and line for anything that does not fit the model.
    """
    location = spec.location
    assert location is not None, "a message's place is found before"
    resolver = _ParameterResolver(spec, model, source, {drawn.draw.name: drawn for drawn in drawn_values})
    params: dict[str, Value] = {}
    for param in spec.params:
        schema = resolver.checked_schema_of(param)
        params[schema.name] = resolver.resolved_value(param, schema)
        if schema.name == "target" and location.anchor.kind in _ANCHOR_KINDS_WITHOUT_TARGET:
            raise source.error(
                param.keys,
                f"'{param.value}' for '{param.key}' at `{location.anchor.kind.value}`",
                expected="no target, because the anchored expression is changed",
                remedy="leave it out, or anchor at a statement",
            )
    for schema in model.params:
        if schema.type == "seed":
            drawn = random_generator(seed, f"{key}/{schema.name}").random()
            params[schema.name] = int(drawn * _MOST_INTEGER_EXACT_AS_FLOAT)
        elif schema.name == "target" and location.anchor.kind in _ANCHOR_KINDS_WITH_DEFAULT_TARGET:
            params.setdefault("target", location.anchor.name)
        at_value = schema.name == "target" and location.anchor.kind in _ANCHOR_KINDS_WITHOUT_TARGET
        if schema.name not in params and not (schema.optional or at_value):
            raise source.error(
                (*spec.keys, "params"),
                f"parameter '{schema.name}' of model {model.name} is missing",
                expected=schema.about,
                remedy=f"add {resolver.example_key(schema)}",
            )
    return Injection(
        location=location,
        model=model.name,
        params=tuple(sorted(params.items())),
        where=spec.where,
        call=spec.call,
        every=spec.every,
    )


class _ParameterResolver:
    def __init__(
        self,
        spec: InjectionSpec,
        model: FaultModel,
        source: YamlSource,
        drawn_by_name: Mapping[str, DrawnValue],
    ) -> None:
        self.spec = spec
        self.model = model
        self.source = source
        self.drawn_by_name = drawn_by_name

    def checked_schema_of(self, param: ParamSpec) -> ParamSchema:
        """Return the schema of a parameter, after checking the dimension of its unit suffix.

        A constant that is not a number must have no unit suffix.
        """
        schema = self.model.param(param.name)
        if schema is None or schema.type == "seed":
            settable = [p for p in self.model.params if p.type != "seed"]
            names = [key for p in settable for key in self.valid_keys(p)]
            raise self.source.error(
                param.keys,
                f"unknown parameter '{param.key}' of model {self.model.name}",
                expected=describe_choices(map(self.example_key, settable)),
                remedy="correct or remove it" + spelling_suggestion(param.key, names),
            )
        unit = None if self.is_verbatim(param, schema) else self.unit_of(schema)
        key_unit = units.UNITS[param.unit] if param.unit else None
        if (unit is None) != (key_unit is None) or (
            unit and key_unit and unit.dimension != key_unit.dimension
        ):
            raise self.source.error(
                param.keys,
                f"'{param.key}'" + (f" (a unit of {key_unit.dimension})" if key_unit else " (no unit)"),
                expected=self.example_key(schema),
                remedy="end the key with the number's unit",
            )
        return schema

    def is_verbatim(self, param: ParamSpec, schema: ParamSchema) -> bool:
        """Return whether a constant is used as it is written.

        That is a literal one, a truth value, None, an integer that is not exact as a float, and a text other
        than the draw's name.
        """
        if schema.type != "constant" or param.unit:
            return False
        if param.is_literal:
            return True
        if not isinstance(param.value, str):
            is_large = isinstance(param.value, int) and abs(param.value) > _MOST_INTEGER_EXACT_AS_FLOAT
            return param.value is None or isinstance(param.value, bool) or is_large
        drawn = parse_draw_reference(param.value)
        return drawn is None or drawn.name not in self.drawn_by_name

    def valid_keys(self, schema: ParamSchema) -> list[str]:
        """Return the keys that a spec can use: one for each unit of the right dimension."""
        unit = self.unit_of(schema)
        if unit is None:
            return [schema.name]
        fitting = [u.suffix for u in units.UNITS.values() if u.dimension == unit.dimension]
        return [f"{schema.name}_{suffix}" for suffix in dict.fromkeys((unit.suffix, *fitting))]

    def example_key(self, schema: ParamSchema) -> str:
        return f"`{self.valid_keys(schema)[0]}`"

    def unit_of(self, schema: ParamSchema) -> units.Unit | None:
        if schema.unit != UNIT_OF_CHANGED_VARIABLE:
            return units.UNITS[schema.unit] if schema.unit else None
        if self.spec.unit is None:
            raise self.source.error(
                self.spec.keys,
                f"model {self.model.name} without `unit`",
                expected=f"the changed variable's unit, one of {units.UNIT_SUFFIXES_TEXT}, or '1'",
                remedy="add `unit: m` (the variable's unit in the source) next to `model`",
            )
        return None if self.spec.unit == units.DIMENSIONLESS else units.UNITS[self.spec.unit]

    def resolved_value(self, param: ParamSpec, schema: ParamSchema) -> Value:
        """Return the value in the template's unit, after checking its type and range."""
        if schema.type in NAME_PARAM_TYPES:
            fits = is_dotted_name if schema.type == "import" else is_assignable
            if not isinstance(param.value, str) or not fits(param.value):
                raise self._value_error(param, _EXPECTED_BY_NAME_TYPE[schema.type])
            return param.value
        if schema.type == "expression":
            if not isinstance(param.value, str) or not is_message_expression(param.value):
                raise self._value_error(param, "an expression of `message`, such as `message.topic`")
            return param.value
        if schema.type == "boolean":
            if not isinstance(param.value, bool):
                raise self._value_error(param, "true or false")
            return param.value
        if schema.type in ("choice", "unit"):
            words = schema.choices if schema.type == "choice" else tuple(units.UNITS)
            if param.value not in words:
                raise self._value_error(param, f"one of {', '.join(words)}")
            return str(param.value)
        if self.is_verbatim(param, schema):
            return self._constant_value(param)
        number = self._number_in_unit(param, schema)
        if schema.type == "integer":
            if not number.is_integer():
                raise self._value_error(param, "a whole number", f"{number}")
            number = int(number)
        low = "" if schema.min is None else f"at least {schema.min:g}"
        high = "" if schema.max is None else f"at most {schema.max:g}"
        below = schema.min is not None and not number >= schema.min
        above = schema.max is not None and not number <= schema.max
        if below or above:
            unit = self.unit_of(schema)
            written = param.value if isinstance(param.value, int | float) else number
            expected = " and ".join(filter(None, (low, high))) + (f" {unit.symbol}" if unit else "")
            raise self._value_error(param, expected, f"{written:g}")
        return number

    def _constant_value(self, param: ParamSpec) -> Value:
        """Return the value; MutatorError for a text that resembles the draw's name, a likely typo."""
        assert not isinstance(param.value, DrawReference)
        if param.is_literal or not isinstance(param.value, str):
            return param.value
        if spelling_suggestion(param.value, list(self.drawn_by_name)):
            raise self._value_error(param, f"{self._draw_names}, or a text that is less similar")
        return param.value

    def _number_in_unit(self, param: ParamSpec, schema: ParamSchema) -> float:
        value = param.value
        unit = self.unit_of(schema)
        if isinstance(value, bool):
            raise self._value_error(param, "a number")
        if isinstance(value, int | float):
            return (
                units.convert_unit(value, units.UNITS[param.unit], unit)
                if unit and param.unit
                else float(value)
            )
        drawn = value if isinstance(value, DrawReference) else parse_draw_reference(str(value))
        if drawn is None or (reference := self.drawn_by_name.get(drawn.name)) is None:
            expected = f"a number, or {self._draw_names}" if self.drawn_by_name else "a number"
            raise self._value_error(param, expected)
        source = units.UNITS[reference.draw.unit] if reference.draw.unit else None
        if unit is None or source is None:
            if unit is not source:
                raise self._value_error(param, "a draw with a unit" if unit else "a draw without a unit")
            return float(drawn.sign * reference.value)
        try:
            return convert_drawn_value(drawn, reference.value, source, unit)
        except ValueError as error:
            raise self._value_error(param, f"the same dimension: {error}") from None

    @property
    def _draw_names(self) -> str:
        names = " or ".join(f"'{name}'" for name in self.drawn_by_name)
        return f"{names}, the draw" + "s" * (len(self.drawn_by_name) > 1)

    def _value_error(self, param: ParamSpec, expected: str, got: str | None = None) -> MutatorError:
        value = param.value.name if isinstance(param.value, DrawReference) else param.value
        text = got or shortened_repr(value)
        return self.source.error(
            param.keys, f"{text} for '{param.key}'", expected=expected, remedy="correct the value"
        )
