"""`progress.json`: what the session that works on a run folder is doing, for whoever watches it.

The session rewrites it with each notice of progress, and deletes it when it ends. After a failure it stays,
with the cause. No result depends on it, and only pages of runs read it.
"""

from collections import Counter
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from mutator._common.confined_files import read_below, unlink_below, write_below
from mutator._common.files import json_bytes, parse_json_object
from mutator._common.hashing import as_json_types
from mutator._common.typed_json import from_json_types
from mutator.errors import MutatorError, TypeMisfit
from mutator.store.run_progress import Progress

PROGRESS_SCHEMA, PROGRESS_FILE = "progress/1", "progress.json"
_MOST = 1e12  # of steps, experiments and s


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionProgress:
    """The values of a Progress, and the `problem` that ended the session; '' while it works."""

    stage: str
    detail: str = ""
    finished_steps: int = 0
    total_steps: int = 0
    outcomes: Mapping[str, int]
    per_s: float | None = None
    remaining_s: float | None = None
    problem: str = ""

    @classmethod
    def of(cls, progress: Progress, problem: str = "") -> "SessionProgress":
        return cls(
            stage=progress.stage,
            detail=progress.detail,
            finished_steps=progress.done,
            total_steps=progress.total,
            outcomes=dict(progress.outcomes),
            per_s=progress.per_s,
            remaining_s=progress.remaining_s,
            problem=problem,
        )

    @property
    def as_progress(self) -> Progress:
        return Progress(
            stage=self.stage,
            detail=self.detail,
            done=self.finished_steps,
            total=self.total_steps,
            outcomes=Counter(self.outcomes),
            per_s=self.per_s,
            remaining_s=self.remaining_s,
        )


def write_session_progress(run: Path, progress: SessionProgress) -> None:
    """Write the file. A full disk, or a strange folder, does not stop the session."""
    with suppress(OSError, MutatorError):
        write_below(run, PROGRESS_FILE, json_bytes({"schema": PROGRESS_SCHEMA} | as_json_types(progress)))


def remove_session_progress(run: Path) -> None:
    with suppress(OSError, MutatorError):
        unlink_below(run, PROGRESS_FILE)


def read_session_progress(run: Path) -> SessionProgress | None:
    """Return what the file says; None without a file that can be read, or with values that no session has."""
    try:
        stored = parse_json_object(read_below(run, PROGRESS_FILE), run / PROGRESS_FILE, PROGRESS_SCHEMA)
        progress = from_json_types(SessionProgress, {key: stored[key] for key in stored if key != "schema"})
    except (OSError, MutatorError, TypeMisfit):
        return None
    numbers = (progress.finished_steps, progress.total_steps, progress.per_s or 0, progress.remaining_s or 0)
    # false for NaN, too
    return progress if all(0 <= n <= _MOST for n in (*numbers, *progress.outcomes.values())) else None
