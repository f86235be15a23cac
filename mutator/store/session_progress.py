"""`progress.json`: what the session that works on a run folder is doing, for whoever watches it.

The session rewrites it with each notice of progress, and deletes it when it ends. After a failure it stays,
with the cause. No result depends on it, and only pages of runs read it.
"""

from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from mutator._common.confined_files import read_below, unlink_below, write_below
from mutator._common.files import json_bytes, parse_json_object
from mutator._common.hashing import as_json_types
from mutator._common.typed_json import typed_value_from_json
from mutator.errors import MutatorError, TypeMisfit
from mutator.store.run_progress import Progress

PROGRESS_SCHEMA, PROGRESS_FILE = "progress/1", "progress.json"
_MOST = 1e12  # of steps, experiments and s


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionProgress:
    """How far a session is, and the `problem` that ended it; empty while it works."""

    progress: Progress
    problem: str


def write_session_progress(run: Path, progress: Progress, problem: str = "") -> None:
    """Write the file. A full disk, or a strange folder, does not stop the session."""
    values = {"schema": PROGRESS_SCHEMA} | as_json_types(progress) | {"problem": problem}
    with suppress(OSError, MutatorError):
        write_below(run, PROGRESS_FILE, json_bytes(values))


def remove_session_progress(run: Path) -> None:
    with suppress(OSError, MutatorError):
        unlink_below(run, PROGRESS_FILE)


def read_session_progress(run: Path) -> SessionProgress | None:
    """Return what the file says; None without a file that can be read, or with values that no session has."""
    try:
        stored = parse_json_object(read_below(run, PROGRESS_FILE), run / PROGRESS_FILE, PROGRESS_SCHEMA)
        problem = typed_value_from_json(str, stored.pop("problem", ""))
        progress = typed_value_from_json(Progress, {key: stored[key] for key in stored if key != "schema"})
    except (OSError, MutatorError, TypeMisfit):
        return None
    numbers = (progress.done, progress.total, progress.per_s or 0, progress.remaining_s or 0)
    # false for NaN, too
    is_possible = all(0 <= n <= _MOST for n in (*numbers, *progress.outcomes.values()))
    return SessionProgress(progress=progress, problem=problem) if is_possible else None
