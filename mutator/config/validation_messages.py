"""Turn pydantic's validation errors into texts: value found, value expected, remedy."""

import types
from collections.abc import Sequence
from dataclasses import fields, is_dataclass
from typing import Annotated, Any, Union, get_args, get_origin, get_type_hints

from pydantic import BaseModel
from pydantic_core import ErrorDetails

from mutator._common.message_text import shown, suggestion

_TYPES = {
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
_SHAPES = ("list_type", "tuple_type", "dict_type", "model_type", "dataclass_type")
_UNKNOWN = ("extra_forbidden", "unexpected_keyword_argument")  # of a model, of a dataclass


def explain(problem: ErrorDetails, model: type[BaseModel]) -> tuple[str, str, str, tuple[str | int, ...]]:
    """Return (got, expected, remedy, keys) for one validation error of `model`."""
    keys, known = _place(model, tuple(problem["loc"]))
    key = next((str(k) for k in reversed(keys) if isinstance(k, str)), "")
    kind = problem["type"]
    context = problem.get("ctx", {})
    if kind in _UNKNOWN:
        return (
            f"unknown key '{key}'",
            f"one of {', '.join(known)}",
            ("correct or remove it" + suggestion(key, known)),
            keys,
        )
    if kind == "missing":
        return f"key '{keys[-1]}' is missing", f"`{keys[-1]}` here", f"add `{keys[-1]}: ...`", keys
    got = f"{shown(problem['input'])} for '{key}'"
    if kind == "value_error":
        return got, str(context.get("error", problem["msg"])), "correct the value", keys
    if kind in _TYPES:
        expected, remedy = _TYPES[kind]
        return got, expected, remedy, keys
    if kind in ("literal_error", "enum"):
        return got, f"one of {context['expected']}", "use one of them", keys
    return got, problem["msg"].removeprefix("Input should be "), "correct the value", keys


def most_telling(found: Sequence[ErrorDetails]) -> ErrorDetails:
    """Choose the error to report. Prefer an unknown key, which can be the misspelling of a missing one.

    If a value can have several shapes, prefer an error about its actual shape.
    """
    shapes = {p["loc"] for p in found if p["type"] in _SHAPES}
    inside = {p["loc"][: len(loc) - 1] for loc in shapes for p in found if len(p["loc"]) > len(loc)}
    apt = [p for p in found if p["loc"] not in shapes or p["loc"][:-1] not in inside]
    return min(apt or found, key=lambda problem: problem["type"] not in _UNKNOWN)


def _place(model: type[BaseModel], loc: tuple[str | int, ...]) -> tuple[tuple[str | int, ...], list[str]]:
    """Return the path of keys to an error, and the valid keys next to the last one.

    For a value with several possible shapes, pydantic's path also names the shape, which is not a key.
    """
    current: Any = model
    keys: list[str | int] = []
    known: list[str] = []
    for key in loc:
        shapes = _shapes(current)
        if len(shapes) > 1:
            current = next((one for one in shapes if _named(one, str(key))), None)
            continue
        (current,) = shapes
        keys.append(key)
        by_key = _fields(current)
        known = list(by_key)
        current = by_key.get(str(key)) if by_key else (get_args(current) or (None,))[-1]
    return tuple(keys), known


def _fields(shape: Any) -> dict[str, Any]:
    """Return the annotations of a model's or a dataclass's fields by key; empty for anything else."""
    if isinstance(shape, type) and issubclass(shape, BaseModel):
        return {field.alias or name: field.annotation for name, field in shape.model_fields.items()}
    if isinstance(shape, type) and is_dataclass(shape):
        hints = get_type_hints(shape, include_extras=True)
        return {field.metadata.get("alias", field.name): hints[field.name] for field in fields(shape)}
    return {}


def _named(shape: Any, tag: str) -> bool:
    """Whether `tag` is pydantic's name of the shape: `list[str]`, or the name of a model."""
    name: str = (get_origin(shape) or shape).__name__
    return tag.partition("[")[0] == name


def _shapes(annotation: Any) -> list[Any]:
    if get_origin(annotation) is Annotated:
        return _shapes(get_args(annotation)[0])
    if get_origin(annotation) in (Union, types.UnionType):
        return [one for part in get_args(annotation) if part is not type(None) for one in _shapes(part)]
    return [annotation]
