"""A cache of finished runs that this machine has verified, keyed by their bytes.

An entry's name is a digest of mutator's version and the SHA-256 of every verified file. A run with any
changed byte is therefore verified in full, even if its digests were recomputed.
"""

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from mutator._common import cache_layout_and_pruning
from mutator._common.bounded_reading import read_bounded
from mutator._common.confined_files import path_below
from mutator._common.files import json_bytes, write_atomic
from mutator._common.hashing import digest
from mutator._common.version import VERSION
from mutator.errors import MutatorError

_SCHEMA = "verified/2"
_PATCH_FILE_GLOB = "patches/*.blocks"  # verified files that are not in the ledger
Sha256ByName = Mapping[str, str | None]  # SHA-256 by name


def list_patch_files(run: Path) -> list[str]:
    return sorted(path.relative_to(run).as_posix() for path in run.glob(_PATCH_FILE_GLOB))


def cache_key(digests: Sha256ByName) -> str:
    return digest([_SCHEMA, VERSION, sorted(digests.items())])


def recall_facts(key: str) -> dict[str, Any]:
    """Return what the cache knows about a run; empty for an unknown run."""
    path = _entry_path(key)
    try:
        data = json.loads(read_bounded(path))
        if data.pop("sum") == digest([key, data]):
            os.utime(path)  # mark as used
            return dict(data)
    except (OSError, MutatorError, ValueError, KeyError, TypeError, AttributeError):
        pass
    return {}


def remember_facts(key: str, **facts: Any) -> None:
    """Add to what the cache knows about a run. An unwritable cache is ignored."""
    data = recall_facts(key) | facts
    path = _entry_path(key)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_atomic(path, json_bytes({"sum": digest([key, data]), **data}))
    except (OSError, MutatorError):
        return


def _entry_path(key: str) -> Path:
    return path_below(cache_layout_and_pruning.cached_verifications_folder(), f"{key}.json")
