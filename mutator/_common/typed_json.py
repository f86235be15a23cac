"""Read values from the JSON types into which `hashing.plain` converts them.

What fits follows from the annotations alone: a dataclass is an object, a named tuple the list of its values,
another tuple a list, a mapping an object with any keys. Only the standard library is used, because workers
read heads of runs.
"""

import dataclasses
import re
from collections.abc import Callable, Mapping, Sequence
from enum import Enum
from functools import cache
from types import NoneType, UnionType
from typing import Any, TypeVar, Union, cast, get_args, get_origin, get_type_hints

from mutator._common.hashing import is_added
from mutator.errors import Misfit, MutatorError

_T = TypeVar("_T")
_Reader = Callable[[Any], Any]
_WORDS = {str: "text", int: "a whole number", float: "a number", bool: "true or false", NoneType: "null"}
_SURROGATE = re.compile("[\ud800-\udfff]")
_LONGEST = 60  # of a value in a message, in characters


def from_plain(kind: type[_T], data: object) -> _T:
    """Read a value of this type. Misfit for a value of another type, or a missing or unknown key.

    Only keys of `added` fields can be missing.
    """
    return cast(_T, _reader(cast(Any, kind))(data))


@cache
def _reader(kind: Any) -> _Reader:
    origin, arguments = get_origin(kind), get_args(kind)
    if kind is Any:
        return lambda data: data
    if origin in (Union, UnionType):
        return _either(kind, [_reader(one) for one in arguments])
    if origin is Mapping:
        return _by_name(_reader(arguments[1]))
    if origin is tuple and arguments[-1] is Ellipsis:
        return _each(_reader(arguments[0]))
    if origin is tuple:
        return _row([_reader(one) for one in arguments], tuple)
    if dataclasses.is_dataclass(kind):
        return _record(cast(type[Any], kind))
    if issubclass(kind, tuple):
        values = [_reader(one) for one in get_type_hints(kind).values()]
        return _row(values, lambda items: kind(*items))
    return _member(kind) if issubclass(kind, Enum) else _scalar(kind)


def _scalar(kind: type) -> _Reader:
    kinds = (float, int) if kind is float else (kind,)

    def read(data: Any) -> Any:
        if type(data) not in kinds or not _is_writable(data):  # a bool is no number
            raise Misfit(_described(data), _WORDS[kind])
        return data

    return read


def _is_writable(data: object) -> bool:
    """Return whether a file can have this value: JSON can spell half of a character."""
    return not isinstance(data, str) or data.isascii() or _SURROGATE.search(data) is None


def _member(kind: type[Enum]) -> _Reader:
    values = {one.value: one for one in kind}

    def read(data: Any) -> Any:
        if not isinstance(data, str) or data not in values:
            raise Misfit(_described(data), f"one of {', '.join(values)}")
        return values[data]

    return read


def _each(item: _Reader) -> _Reader:
    def read(data: Any) -> Any:
        return tuple(_within(place, item, one) for place, one in enumerate(_checked(data, list)))

    return read


def _row(items: Sequence[_Reader], made: Callable[[list[Any]], Any]) -> _Reader:
    def read(data: Any) -> Any:
        if len(_checked(data, list)) != len(items):
            raise Misfit(f"a list of {len(data)}", f"a list of {len(items)}")
        return made([_within(place, item, data[place]) for place, item in enumerate(items)])

    return read


def _by_name(item: _Reader) -> _Reader:
    def read(data: Any) -> Any:
        return {name: _within(name, item, one) for name, one in _checked(data, dict).items()}

    return read


def _either(kind: Any, readers: Sequence[_Reader]) -> _Reader:
    """Read with the first reader that fits. If none does, tell where the one that came farthest failed."""
    expected = " or ".join(_WORDS.get(one, "an object or a list") for one in get_args(kind))

    def read(data: Any) -> Any:
        misfits = []
        for one in readers:
            try:
                return one(data)
            except Misfit as err:
                misfits.append(err)
        farthest = max(misfits, key=lambda err: len(err.path))
        raise farthest if farthest.path else Misfit(_described(data), expected)

    return read


def _record(kind: type[Any]) -> _Reader:
    hints = get_type_hints(kind)
    readers = {field.name: _reader(hints[field.name]) for field in dataclasses.fields(kind)}
    needed = [field.name for field in dataclasses.fields(kind) if not is_added(field)]

    def read(data: Any) -> Any:
        _checked(data, dict)
        if missing := [name for name in needed if name not in data]:
            raise Misfit(f"no key '{missing[0]}'")
        if unknown := [name for name in data if name not in readers]:
            raise Misfit(f"an unknown key {_described(unknown[0])}", f"only {', '.join(readers)}")
        values = {name: _within(name, readers[name], one) for name, one in data.items()}
        try:
            return kind(**values)
        except (ValueError, MutatorError) as err:
            raise Misfit(str(err)) from None

    return read


def _within(key: str | int, read: _Reader, data: Any) -> Any:
    try:
        return read(data)
    except Misfit as err:
        err.path.insert(0, key)
        raise


def _checked(data: Any, kind: type[list[Any]] | type[dict[str, Any]]) -> Any:
    if type(data) is not kind:
        raise Misfit(_described(data), "a list" if kind is list else "an object")
    return data


def _described(data: Any) -> str:
    if isinstance(data, list | dict):
        return "a list" if isinstance(data, list) else "an object"
    text = ascii(data)
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]}..."
