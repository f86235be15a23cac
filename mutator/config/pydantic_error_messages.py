"""Turn pydantic's validation errors into texts: value found, value expected, remedy."""

import types
from collections.abc import Sequence
from dataclasses import fields, is_dataclass
from typing import Annotated, Any, Union, get_args, get_origin, get_type_hints

from pydantic import BaseModel
from pydantic_core import ErrorDetails

from mutator._common.message_text import shortened_repr, spelling_suggestion

_EXPECTED_AND_REMEDY_BY_ERROR = {
    "float_type": ("a number", "write it as a number, without quotes or unit"),
    "int_type": ("a whole number", "write it as a number, without quotes or unit"),
    "int_from_float": ("a whole number", "write it without a fraction"),
    "string_type": ("text", "put it in quotes"),
    "bool_type": ("true or false", "write true or false"),
    "list_type": ("a list", "write [a, b], or one item per line after a dash"),
    "tuple_type": ("a list", "write [a, b], or one item per line after a dash"),
    "dict_type": ("a mapping", "write `key: value` lines beneath it"),
    "model_type": ("a mapping", "write `key: value` lines beneath it"),
    "dataclass_type": ("a mapping", "write `key: value` lines beneath it"),
    "finite_number": ("a finite number", "write an ordinary number"),
}
# if a key accepts several shapes, pydantic reports one of these for each that the value does not have
_WRONG_SHAPE_ERRORS = ("list_type", "tuple_type", "dict_type", "model_type", "dataclass_type")
_UNKNOWN_KEY_ERRORS = ("extra_forbidden", "unexpected_keyword_argument")  # of a model, of a dataclass


def got_expected_remedy_and_keys(
    problem: ErrorDetails, model: type[BaseModel]
) -> tuple[str, str, str, tuple[str | int, ...]]:
    """Return (got, expected, remedy, keys) for one validation error of `model`."""
    keys, valid_keys = _error_keys_and_valid_keys(model, tuple(problem["loc"]))
    key = next((str(k) for k in reversed(keys) if isinstance(k, str)), "")
    kind = problem["type"]
    context = problem.get("ctx", {})
    if kind in _UNKNOWN_KEY_ERRORS:
        return (
            f"unknown key '{key}'",
            f"one of {', '.join(valid_keys)}",
            ("correct or remove it" + spelling_suggestion(key, valid_keys)),
            keys,
        )
    if kind == "missing":
        return f"key '{keys[-1]}' is missing", f"`{keys[-1]}` here", f"add `{keys[-1]}: ...`", keys
    got = f"{shortened_repr(problem['input'])} for '{key}'"
    if kind == "value_error":
        return got, str(context.get("error", problem["msg"])), "correct the value", keys
    if kind in _EXPECTED_AND_REMEDY_BY_ERROR:
        expected, remedy = _EXPECTED_AND_REMEDY_BY_ERROR[kind]
        return got, expected, remedy, keys
    if kind in ("literal_error", "enum"):
        return got, f"one of {context['expected']}", "use one of them", keys
    return got, problem["msg"].removeprefix("Input should be "), "correct the value", keys


def choose_error_to_report(errors: Sequence[ErrorDetails]) -> ErrorDetails:
    """Choose the error to report. Prefer an unknown key, which can be the misspelling of a missing one.

    If a value can have several shapes, prefer an error about its actual shape.
    """
    shapes = {p["loc"] for p in errors if p["type"] in _WRONG_SHAPE_ERRORS}
    inside = {p["loc"][: len(loc) - 1] for loc in shapes for p in errors if len(p["loc"]) > len(loc)}
    apt = [p for p in errors if p["loc"] not in shapes or p["loc"][:-1] not in inside]
    return min(apt or errors, key=lambda problem: problem["type"] not in _UNKNOWN_KEY_ERRORS)


def _error_keys_and_valid_keys(
    model: type[BaseModel], loc: tuple[str | int, ...]
) -> tuple[tuple[str | int, ...], list[str]]:
    """Return the path of keys to an error, and the valid keys next to the last one.

    For a value with several possible shapes, pydantic's path also names the shape, which is not a key.
    """
    current: Any = model
    keys: list[str | int] = []
    valid_keys: list[str] = []
    for key in loc:
        shapes = _possible_shapes(current)
        if len(shapes) > 1:
            current = next((shape for shape in shapes if _has_tag(shape, str(key))), None)
            continue
        (current,) = shapes
        keys.append(key)
        by_key = _field_types(current)
        valid_keys = list(by_key)
        current = by_key.get(str(key)) if by_key else (get_args(current) or (None,))[-1]
    return tuple(keys), valid_keys


def _field_types(shape: Any) -> dict[str, Any]:
    """Return the annotations of a model's or a dataclass's fields by key; empty for anything else."""
    if isinstance(shape, type) and issubclass(shape, BaseModel):
        return {field.alias or name: field.annotation for name, field in shape.model_fields.items()}
    if isinstance(shape, type) and is_dataclass(shape):
        hints = get_type_hints(shape, include_extras=True)
        return {field.metadata.get("alias", field.name): hints[field.name] for field in fields(shape)}
    return {}


def _has_tag(shape: Any, tag: str) -> bool:
    """Whether `tag` is pydantic's name of the shape: `list[str]`, or the name of a model."""
    name: str = (get_origin(shape) or shape).__name__
    return tag.partition("[")[0] == name


def _possible_shapes(annotation: Any) -> list[Any]:
    if get_origin(annotation) is Annotated:
        return _possible_shapes(get_args(annotation)[0])
    if get_origin(annotation) in (Union, types.UnionType):
        return [
            shape
            for part in get_args(annotation)
            if part is not type(None)
            for shape in _possible_shapes(part)
        ]
    return [annotation]
