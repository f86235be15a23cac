"""Turn pydantic's validation errors into texts: value found, value expected, remedy."""

import types
from collections.abc import Sequence
from typing import Annotated, Any, Union, get_args, get_origin

from pydantic import BaseModel
from pydantic_core import ErrorDetails

from mutator._common.text import shown, suggestion

_TYPES = {
    "float_type": ("a number", "write it as a number, without quotes or unit"),
    "int_type": ("a whole number", "write it as a number, without quotes or unit"),
    "int_from_float": ("a whole number", "write it without a fraction"),
    "string_type": ("text", "put it in quotes"),
    "bool_type": ("true or false", "write true or false"),
    "list_type": ("a list", "write [a, b], or one item per line after a dash"),
    "dict_type": ("a mapping", "write `key: value` lines beneath it"),
    "model_type": ("a mapping", "write `key: value` lines beneath it"),
    "finite_number": ("a finite number", "write an ordinary number"),
}


def explain(problem: ErrorDetails, model: type[BaseModel]) -> tuple[str, str, str, tuple[str | int, ...]]:
    """Return (got, expected, remedy, keys) for one validation error of `model`."""
    keys, known = _place(model, tuple(problem["loc"]))
    key = next((str(k) for k in reversed(keys) if isinstance(k, str)), "")
    kind = problem["type"]
    context = problem.get("ctx", {})
    if kind == "extra_forbidden":
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
    shapes = {p["loc"] for p in found if p["type"] in ("list_type", "dict_type", "model_type")}
    inside = {p["loc"][: len(loc) - 1] for loc in shapes for p in found if len(p["loc"]) > len(loc)}
    apt = [p for p in found if p["loc"] not in shapes or p["loc"][:-1] not in inside]
    return min(apt or found, key=lambda problem: problem["type"] != "extra_forbidden")


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
        if isinstance(current, type) and issubclass(current, BaseModel):
            by_alias = {field.alias or name: field for name, field in current.model_fields.items()}
            known = list(by_alias)
            current = by_alias[str(key)].annotation if str(key) in by_alias else None
        else:
            known = []
            current = (get_args(current) or (None,))[-1]
    return tuple(keys), known


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
