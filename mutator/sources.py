"""A target's files in memory: read once, digested once, parsed once."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class SourceTree:
    """Snapshot of a target: path relative to the root -> bytes; `digest` identifies it."""

    root: Path
    files: Mapping[str, bytes]
    digest: str
