"""Content hashes: the same input has the same id on every machine and in every later version.

Publications cite ids and plan digests, so they must not change when records gain fields. Declare such a field
with `added_field(default)`: ids and plan files omit it while it has that default.
"""

import dataclasses
import hashlib
import json
from enum import Enum
from functools import lru_cache
from typing import Any

import orjson

_ADDED_KEY = "added"  # metadata key of a field
_SCALAR_TYPES = frozenset((str, int, float, bool, type(None)))  # exact types: an enum of texts is converted


def added_field(default: Any, metadata: dict[str, Any] | None = None) -> Any:
    """Declare a dataclass field that is added to a hashed record after the record's first release.

    Files without the field are read with `default`, which must be immutable and must never change.
    """
    return dataclasses.field(default=default, metadata={_ADDED_KEY: True, **(metadata or {})})


def is_added_field(field: "dataclasses.Field[Any]") -> bool:
    return _ADDED_KEY in field.metadata


def non_default_added_fields(record: Any) -> dict[str, Any]:
    """Return the `added` fields of a dataclass instance that differ from the defaults, as JSON types."""
    _, later = _first_and_added_fields(type(record))  # type: ignore[arg-type]  # classes are hashable
    if not later:
        return {}
    changed = [name for name, default in later if getattr(record, name) != default]
    return {name: as_json_types(getattr(record, name)) for name in changed}


@lru_cache(maxsize=256)
def _first_and_added_fields(kind: type) -> tuple[tuple[str, ...], tuple[tuple[str, Any], ...]]:
    every = dataclasses.fields(kind)
    first = tuple(f.name for f in every if not is_added_field(f))
    return first, tuple((f.name, f.default) for f in every if is_added_field(f))


def parse_json(data: bytes) -> Any:
    """Parse JSON four times as fast as `json.loads`; integers of more than 64 bits become floats."""
    try:
        return orjson.loads(data)
    except ValueError:  # orjson also rejects NaN
        return json.loads(data)


def as_json_types(value: Any) -> Any:
    """Convert records, tuples and enums into JSON types, omitting `added` fields that have their defaults."""
    if type(value) in _SCALAR_TYPES:
        return value
    if isinstance(value, Enum):  # tested first, because `is_dataclass` is slow for enums
        return value.value
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        values = {}
        for name in _first_and_added_fields(type(value))[0]:
            field_value = getattr(value, name)
            values[name] = field_value if type(field_value) in _SCALAR_TYPES else as_json_types(field_value)
        return values | non_default_added_fields(value)
    if isinstance(value, dict):
        return {str(k): as_json_types(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [as_json_types(v) for v in value]
    return value


# for speed (a plan can have a million ids), `as_json_types` converts only the types that JSON lacks
_CANONICAL_ENCODER = json.JSONEncoder(
    default=as_json_types, sort_keys=True, separators=(",", ":"), ensure_ascii=False
)


def canonical_json(value: Any) -> str:
    """Return the canonical JSON text of a value: sorted keys, no spaces, shortest exact floats."""
    return _CANONICAL_ENCODER.encode(value)


def digest(value: Any) -> str:
    """Return the SHA-256 in hex of `value` itself if it is bytes, of its canonical text otherwise."""
    data = value if isinstance(value, bytes) else canonical_json(value).encode()
    return hashlib.sha256(data).hexdigest()


def content_id(value: Any) -> str:
    """Return the first 16 digits of `digest`. Among 10^6 items, the odds of a clash are 1 in 37 million."""
    return digest(value)[:16]
