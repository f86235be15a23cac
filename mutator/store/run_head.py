"""Read and check `run.json`. Damage is reported with its key, whichever version wrote the file."""

from collections.abc import Iterator, Mapping
from dataclasses import fields
from functools import cached_property
from pathlib import Path
from types import NoneType
from typing import Any

from mutator._common.below import check_library_name, check_name
from mutator._common.files import read_json
from mutator._common.places import RUN_HEAD
from mutator.errors import MutatorError
from mutator.model import Limits
from mutator.targets.severity import Scale
from mutator.targets.target_facts import ChannelFacts, MetricFacts

SCHEMA = "run/3"
HEAD, CAMPAIGN = RUN_HEAD, "campaign.yaml"
REMEDY = "the run folder is damaged: restore the file from a copy of it"
_TEXTS = {str: str}
# Types of values: `[x]` a list of x; `{str: x}` x by name; `{"a": x}` an x under `a`; `(x, y)` either.
_STRETCH = {
    "python": str,
    "packages": _TEXTS,
    "platform": str,
    "cpu": str | None,
    "blas": [dict.fromkeys(("library", "version", "kernel"), str | None) | {"threads": int | None}],
    "threads": _TEXTS,
    "git": ({str: {"commit": str, "changed": bool}}, NoneType),
    "records": str,
    "accepted": [str],
    "machines": [{"worker": str, "host": str, "python": str, "platform": str}],
}
_OPTIONAL = {"machines"}  # left out without a cluster
_SHAPES: dict[str, Any] = {
    "plan": str,
    "campaign": str,
    "campaign_digest": str,
    "target": str,
    "seed": int,
    "seeds": [int],
    "reading": str,
    "choices": {str: str | int | None},
    "experiments": int,
    "runs": int,
    "limits": {str: int},
    "hazards": [str],
    "alerts": [str],
    "compared": [str],
    "metrics": [[str]],
    "severity": ({"name": str, "about": str, "source": str, "classes": [list]}, NoneType),
    "about_hazards": [{"name": str, "about": str, "terminal": bool}],
    "channels": [[str]],
    "structure": ({str: object}, NoneType),
    "goldens": [list],
    "golden_files": [str],
    "canary": {str: object},
    "canary_hazard": str,
    "sources": _TEXTS,
    "target_files": _TEXTS,
    "provenance": {str: (str, _TEXTS)},
    "stretches": [_STRETCH],
    "chunks": [[int]],
}
_SIZES = {"goldens": (2, 3), "chunks": (3,), "metrics": (4,)}  # allowed lengths of items


class Head(dict[str, Any]):
    """The content of a run.json; reading a missing key raises MutatorError."""

    def __init__(self, path: Path, content: Mapping[str, Any]) -> None:
        super().__init__(content)
        self.path = path

    @cached_property
    def channels(self) -> tuple[ChannelFacts, ...]:
        return tuple(map(ChannelFacts.from_plain, self.get("channels", ())))

    @cached_property
    def metrics(self) -> tuple[MetricFacts, ...]:
        return tuple(map(MetricFacts.from_plain, self.get("metrics", ())))

    def __missing__(self, key: str) -> Any:
        raise MutatorError(f"no key '{key}'", where=self.path, expected="a complete run.json", remedy=REMEDY)


def read_head(run: Path) -> Head:
    """Read the head of a run folder; MutatorError if it is damaged or has another schema."""
    path = run / HEAD
    head = Head(path, read_json(path, SCHEMA))
    if wrong := next(_wrong(head), ""):
        raise MutatorError(f"damaged at '{wrong}'", where=path, remedy=REMEDY)
    _check_names(head)
    if "provenance" in head:
        head["provenance"] = Head(path, head["provenance"])
    return head


def _check_names(head: Head) -> None:
    """Raise Outside for the path of a file where the name of a file belongs."""
    for name in head.get("golden_files", ()):
        check_name(name, head.path)
    for name in (head.get("target", ""), *(str(golden[0]) for golden in head.get("goldens", ()))):
        check_library_name(name, head.path)


def _wrong(head: Head) -> Iterator[str]:
    yield from (key for key, shape in _SHAPES.items() if key in head and not _fits(head[key], shape))
    known = {field.name for field in fields(Limits)}
    if not head.get("limits", {}).keys() <= known:
        yield "limits"
    yield from (
        key for key, size in _SIZES.items() if any(len(item) not in size for item in head.get(key, ()))
    )
    try:
        _ = head.channels
    except ValueError:
        yield "channels"
    try:
        if told := head.get("severity"):
            Scale.from_plain(told).class_of(0.0)
    except (ValueError, TypeError, IndexError):
        yield "severity"


def _fits(value: object, shape: Any) -> bool:
    if isinstance(shape, tuple):
        return any(_fits(value, one) for one in shape)
    if isinstance(shape, list):
        return isinstance(value, list) and all(_fits(item, shape[0]) for item in value)
    if isinstance(shape, dict):
        if not isinstance(value, dict):
            return False
        if str in shape:
            return all(_fits(item, shape[str]) for item in value.values())
        wanted = {key: shape[key] for key in shape if key in value or key not in _OPTIONAL}
        return all(key in value and _fits(value[key], wanted[key]) for key in wanted)
    return isinstance(value, shape)
