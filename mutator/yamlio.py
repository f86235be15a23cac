"""YAML at the edge: strict, with a line for every value, so that an error can point at its place.

The dialect is YAML 1.2's core: `true`/`false`, `null`, decimal numbers, strings; no tags, no anchors and
aliases (a small file could unfold into gigabytes), one document a file, no key twice.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict

from mutator.errors import MutatorError

Keys = tuple[str | int, ...]
M = TypeVar("M", bound="StrictModel")


class StrictModel(BaseModel):
    """Base of every file's shape: no unknown key, no silent change of a value's type."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


@dataclass(frozen=True, slots=True, kw_only=True)
class Source:
    """A parsed file and where its values stand: `lines` maps a path of keys to a line (from 1)."""

    path: Path
    data: Any
    lines: dict[Keys, int]

    def line(self, keys: Keys) -> int | None:
        """Line of the value at `keys`, or of the nearest thing around it."""
        raise NotImplementedError

    def error(
        self, keys: Keys, got: str, *, expected: str | None = None, remedy: str | None = None
    ) -> MutatorError:
        """An error (not raised) that points at the value at `keys`."""
        raise NotImplementedError


def load(path: Path) -> Source:
    """Parse one YAML file strictly; MutatorError with file and line for anything wrong with it."""
    raise NotImplementedError


def read(path: Path, model: type[M], schema: str) -> tuple[M, Source]:
    """Parse `path`, check its `schema: name/version` key against `schema`, validate the rest as `model`.

    The schema key is not part of the model. A newer version, an unknown or doubled key, a wrong type
    or a value out of range is a MutatorError with file, line, value, what was expected, and a remedy.
    """
    raise NotImplementedError
