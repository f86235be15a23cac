"""Content hashes: the same input gives the same id on every machine, in this version and in later ones.

Ids and plan digests are cited, so they must outlive new fields. A field that joins a hashed record is
declared with `added(default)`: ids and plan files leave it out while it holds that default.
"""

import dataclasses
import hashlib
import json
from enum import Enum
from functools import lru_cache
from typing import Any

import orjson

_ADDED = "added"  # key in a field's metadata
_SCALARS = frozenset((str, int, float, bool, type(None)))


def added(default: Any) -> Any:
    """Declare a dataclass field that joins a hashed record after its first release.

    No id changes: `plain` leaves the field out while it equals `default`, and readers of older files, which
    lack it, give it `default`. The default must be immutable and must never change.
    """
    return dataclasses.field(default=default, metadata={_ADDED: True})


def added_values(record: Any) -> dict[str, Any]:
    """The `added` fields of a dataclass instance that differ from their defaults, as `plain` values."""
    _, later = _fields(type(record))  # type: ignore[arg-type]  # classes are hashable, says Python
    if not later:
        return {}
    changed = [name for name, default in later if getattr(record, name) != default]
    return {name: plain(getattr(record, name)) for name in changed}


@lru_cache(maxsize=256)
def _fields(kind: type) -> tuple[tuple[str, ...], tuple[tuple[str, Any], ...]]:
    """Names of a dataclass's first fields; names and defaults of its `added` ones."""
    every = dataclasses.fields(kind)
    first = tuple(f.name for f in every if _ADDED not in f.metadata)
    return first, tuple((f.name, f.default) for f in every if _ADDED in f.metadata)


def from_json(data: bytes) -> Any:
    """What `json.loads` makes of `data`, or raises, in a quarter of its time; but integers of more than 64
    bits become floats."""
    try:
        return orjson.loads(data)
    except ValueError:  # also of what it is too strict for, like nan
        return json.loads(data)


def plain(value: Any) -> Any:
    """Turn records, tuples and enums into what JSON knows; floats stay as they are.

    Of a record's `added` fields only those count that differ from their defaults.
    """
    if type(value) in _SCALARS:
        return value
    if isinstance(value, Enum):  # first, as an enumeration takes long to say that it has no fields
        return value.value
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        found = {}
        for name in _fields(type(value))[0]:
            one = getattr(value, name)
            found[name] = one if type(one) in _SCALARS else plain(one)
        return found | added_values(value)
    if isinstance(value, dict):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [plain(v) for v in value]
    return value


# only what JSON does not know goes through `plain`: a plan has a million ids
_ENCODER = json.JSONEncoder(default=plain, sort_keys=True, separators=(",", ":"), ensure_ascii=False)


def canonical(value: Any) -> str:
    """One text for one value: sorted keys, no spaces, shortest exact floats."""
    return _ENCODER.encode(value)


def digest(value: Any) -> str:
    """SHA-256 of `value` (bytes as they are, anything else in its canonical text), in hex."""
    data = value if isinstance(value, bytes) else canonical(value).encode()
    return hashlib.sha256(data).hexdigest()


def content_id(value: Any) -> str:
    """The first 16 hex digits of `digest`: among 10^6 things a clash has odds of 1 in 37 million."""
    return digest(value)[:16]
