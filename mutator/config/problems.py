"""Words for what pydantic found wrong with a file: value shown, what was expected, a remedy."""

import types
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
    "list_type": ("a list", "write [a, b] or one item a line, each after a dash"),
    "dict_type": ("a mapping", "write `key: value` lines beneath it"),
    "model_type": ("a mapping", "write `key: value` lines beneath it"),
    "finite_number": ("a finite number", "write an ordinary number"),
}


def explain(problem: ErrorDetails, model: type[BaseModel]) -> tuple[str, str, str, tuple[str | int, ...]]:
    """(got, expected, remedy, keys) for one validation problem of `model`."""
    keys = tuple(problem["loc"])
    key = next((str(k) for k in reversed(keys) if isinstance(k, str)), "")
    kind = problem["type"]
    context = problem.get("ctx", {})
    if kind == "extra_forbidden":
        known = _fields_at(model, keys[:-1])
        return (
            f"unknown key '{key}'",
            f"one of {', '.join(known)}",
            ("correct or remove it" + suggestion(key, known)),
            keys,
        )
    if kind == "missing":
        return f"key '{keys[-1]}' is missing", "it here", f"add `{keys[-1]}: ...`", keys
    got = f"{shown(problem['input'])} for '{key}'"
    if kind == "value_error":
        return got, str(context.get("error", problem["msg"])), "correct the value", keys
    if kind in _TYPES:
        expected, remedy = _TYPES[kind]
        return got, expected, remedy, keys
    if kind in ("literal_error", "enum"):
        return got, f"one of {context['expected']}", "use one of them", keys
    return got, problem["msg"].removeprefix("Input should be "), "correct the value", keys


def _fields_at(model: type[BaseModel], keys: tuple[str | int, ...]) -> list[str]:
    """Names of the keys that the model found at `keys` takes."""
    current: Any = model
    for key in keys:
        if isinstance(current, type) and issubclass(current, BaseModel):
            by_alias = {field.alias or name: field for name, field in current.model_fields.items()}
            current = _inner(by_alias[str(key)].annotation)
        else:
            current = _inner(get_args(current)[-1])
    if isinstance(current, type) and issubclass(current, BaseModel):
        return [field.alias or name for name, field in current.model_fields.items()]
    return []


def _inner(annotation: Any) -> Any:
    """`X` of `X | None` and of `Annotated[X, ...]`; anything else as it is."""
    if get_origin(annotation) is Annotated:
        return _inner(get_args(annotation)[0])
    if get_origin(annotation) in (Union, types.UnionType):
        return next(a for a in get_args(annotation) if a is not type(None))
    return annotation
