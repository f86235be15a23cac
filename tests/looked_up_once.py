"""Makes mutator remember, during a test session, what it looks up on the machine for each run.

Sessions of tests drive hundreds of runs, and on a machine that does not change meanwhile.
"""

import importlib.metadata
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

import mutator
from mutator.campaigns import run_provenance
from mutator.store.session_environments import GitCloneState

_HARNESS_FOLDER = Path(mutator.__file__).parent


@contextmanager
def looked_up_once() -> Iterator[None]:
    """List entry points, and compare the harness with its commit, only once: again where the path changes."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(importlib.metadata, "entry_points", _entry_points())
        patch.setattr(run_provenance, "find_clone_state", _clone_state())
        yield


def _entry_points() -> Callable[..., Any]:
    """Remember the entry points while no folder on the path changes."""
    look_up = importlib.metadata.entry_points
    remembered: dict[object, Any] = {}

    def entry_points(**selection: Any) -> Any:
        path = [(place, Path(place).stat().st_mtime_ns if Path(place).exists() else 0) for place in sys.path]
        key = tuple(path), tuple(sorted(selection.items()))
        if key not in remembered:
            remembered[key] = look_up(**selection)
        return remembered[key]

    return entry_points


def _clone_state() -> Callable[[Path], GitCloneState | None]:
    """Remember the state of the harness's clone. Other folders are the tests' own."""
    look_up = run_provenance.find_clone_state
    remembered: list[GitCloneState | None] = []

    def find_clone_state(folder: Path) -> GitCloneState | None:
        if folder != _HARNESS_FOLDER:
            return look_up(folder)
        if not remembered:
            remembered.append(look_up(folder))
        return remembered[0]

    return find_clone_state
