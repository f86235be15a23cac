"""Read values from the JSON types into which `hashing.as_json_types` converts them.

What fits follows from the annotations alone: a dataclass is an object, a named tuple the list of its values,
another tuple a list, a mapping or counter an object with any keys. Only the standard library is used, because
workers read heads of runs.
"""

import dataclasses
import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from enum import Enum
from functools import cache
from types import NoneType, UnionType
from typing import Any, TypeVar, Union, cast, get_args, get_origin, get_type_hints

from mutator._common.hashing import is_added_field
from mutator.errors import MutatorError, TypeMisfit

_ValueT = TypeVar("_ValueT")
_Reader = Callable[[Any], Any]
_TYPE_DESCRIPTIONS = {
    str: "text",
    int: "a whole number",
    float: "a number",
    bool: "true or false",
    NoneType: "null",
}
_SURROGATE_PATTERN = re.compile("[\ud800-\udfff]")
_MOST_VALUE_LENGTH = 60  # of a value in a message, in characters


def typed_value_from_json(kind: type[_ValueT], data: object) -> _ValueT:
    """Read a value of this type. Misfit for a value of another type, or a missing or unknown key.

    Only keys of `added` fields can be missing.
    """
    return cast(_ValueT, _reader_of(cast(Any, kind))(data))


@cache
def _reader_of(kind: Any) -> _Reader:
    origin, arguments = get_origin(kind), get_args(kind)
    if kind is Any:
        return lambda data: data
    if origin in (Union, UnionType):
        return _union_reader(kind, [_reader_of(part) for part in arguments])
    if origin is Mapping:
        return _mapping_reader(_reader_of(arguments[1]))
    if origin is Counter:
        counts = _mapping_reader(_reader_of(int))
        return lambda data: Counter(counts(data))
    if origin is tuple and arguments[-1] is Ellipsis:
        return _tuple_reader(_reader_of(arguments[0]))
    if origin is tuple:
        return _fixed_list_reader([_reader_of(annotation) for annotation in arguments], tuple)
    if dataclasses.is_dataclass(kind):
        return _dataclass_reader(cast(type[Any], kind))
    if issubclass(kind, tuple):
        values = [_reader_of(annotation) for annotation in get_type_hints(kind).values()]
        return _fixed_list_reader(values, lambda items: kind(*items))
    return _enum_reader(kind) if issubclass(kind, Enum) else _scalar_reader(kind)


def _scalar_reader(kind: type) -> _Reader:
    kinds = (float, int) if kind is float else (kind,)

    def read(data: Any) -> Any:
        if type(data) not in kinds or not _is_encodable(data):  # a bool is no number
            raise TypeMisfit(_describe_misfit(data), _TYPE_DESCRIPTIONS[kind])
        return data

    return read


def _is_encodable(data: object) -> bool:
    """Return whether a file can have this value: JSON can spell half of a character."""
    return not isinstance(data, str) or data.isascii() or _SURROGATE_PATTERN.search(data) is None


def _enum_reader(kind: type[Enum]) -> _Reader:
    values = {member.value: member for member in kind}

    def read(data: Any) -> Any:
        if not isinstance(data, str) or data not in values:
            raise TypeMisfit(_describe_misfit(data), f"one of {', '.join(values)}")
        return values[data]

    return read


def _tuple_reader(item: _Reader) -> _Reader:
    def read(data: Any) -> Any:
        return tuple(
            _read_within(index, item, element) for index, element in enumerate(_checked_container(data, list))
        )

    return read


def _fixed_list_reader(items: Sequence[_Reader], build: Callable[[list[Any]], Any]) -> _Reader:
    def read(data: Any) -> Any:
        if len(_checked_container(data, list)) != len(items):
            raise TypeMisfit(f"a list of {len(data)}", f"a list of {len(items)}")
        return build([_read_within(place, item, data[place]) for place, item in enumerate(items)])

    return read


def _mapping_reader(item: _Reader) -> _Reader:
    def read(data: Any) -> Any:
        return {
            name: _read_within(name, item, value) for name, value in _checked_container(data, dict).items()
        }

    return read


def _union_reader(kind: Any, readers: Sequence[_Reader]) -> _Reader:
    """Read with the first reader that fits. If none does, tell where the one that came farthest failed."""
    expected = " or ".join(_TYPE_DESCRIPTIONS.get(part, "an object or a list") for part in get_args(kind))

    def read(data: Any) -> Any:
        misfits = []
        for reader in readers:
            try:
                return reader(data)
            except TypeMisfit as err:
                misfits.append(err)
        farthest = max(misfits, key=lambda err: len(err.path))
        raise farthest if farthest.path else TypeMisfit(_describe_misfit(data), expected)

    return read


def _dataclass_reader(kind: type[Any]) -> _Reader:
    hints = get_type_hints(kind)
    readers = {field.name: _reader_of(hints[field.name]) for field in dataclasses.fields(kind)}
    needed = [field.name for field in dataclasses.fields(kind) if not is_added_field(field)]

    def read(data: Any) -> Any:
        _checked_container(data, dict)
        if missing := [name for name in needed if name not in data]:
            raise TypeMisfit(f"no key '{missing[0]}'")
        if unknown := [name for name in data if name not in readers]:
            raise TypeMisfit(f"an unknown key {_describe_misfit(unknown[0])}", f"only {', '.join(readers)}")
        values = {name: _read_within(name, readers[name], value) for name, value in data.items()}
        try:
            return kind(**values)
        except (ValueError, MutatorError) as err:
            raise TypeMisfit(str(err)) from None

    return read


def _read_within(key: str | int, read: _Reader, data: Any) -> Any:
    try:
        return read(data)
    except TypeMisfit as err:
        err.path.insert(0, key)
        raise


def _checked_container(data: Any, kind: type[list[Any]] | type[dict[str, Any]]) -> Any:
    if type(data) is not kind:
        raise TypeMisfit(_describe_misfit(data), "a list" if kind is list else "an object")
    return data


def _describe_misfit(data: Any) -> str:
    if isinstance(data, list | dict):
        return "a list" if isinstance(data, list) else "an object"
    text = ascii(data)
    return text if len(text) <= _MOST_VALUE_LENGTH else f"{text[:_MOST_VALUE_LENGTH]}..."
