"""Content hashes: the same input gives the same id on every machine."""

import dataclasses
import hashlib
import json
from enum import Enum
from typing import Any


def plain(value: Any) -> Any:
    """Turn records, tuples and enums into what JSON knows; floats stay as they are."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if isinstance(value, dict):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [plain(v) for v in value]
    if isinstance(value, Enum):
        return value.value
    return value


def canonical(value: Any) -> str:
    """One text for one value: sorted keys, no spaces, shortest exact floats."""
    # only what JSON does not know goes through `plain`: a plan has thousands of ids
    return json.dumps(value, default=plain, sort_keys=True, separators=(",", ":"), ensure_ascii=False)


def digest(value: Any) -> str:
    """SHA-256 of `value` (bytes as they are, anything else in its canonical text), in hex."""
    data = value if isinstance(value, bytes) else canonical(value).encode()
    return hashlib.sha256(data).hexdigest()


def content_id(value: Any) -> str:
    """The first 16 hex digits of `digest`: among 10^6 things a clash has odds of 1 in 37 million."""
    return digest(value)[:16]
