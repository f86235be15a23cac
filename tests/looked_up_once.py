"""Makes mutator remember, during a test session, what it looks up on the machine for each run.

A run of the toy car takes two seconds, and half of them were these look-ups.
"""

import importlib.metadata
import os
import stat
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

import mutator
from mutator import workspace
from mutator.campaigns import run_environment, run_provenance
from mutator.faults import fault_model_files
from mutator.faults.fault_models import FaultModels
from mutator.store.session_environments import GitCloneState

_HARNESS_FOLDER = Path(mutator.__file__).parent
_SMALL = 1 << 20  # bytes


@contextmanager
def looked_up_once() -> Iterator[None]:
    """Resolve requirements of packages, list entry points, compare the harness with its commit, and check
    links of a templates folder only once, and again where something could have changed.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(run_environment, "required_packages", _required_packages())
        patch.setattr(importlib.metadata, "entry_points", _entry_points())
        patch.setattr(run_provenance, "find_clone_state", _clone_state())
        patch.setattr(workspace, "load_fault_models", _fault_models())
        yield


def _required_packages() -> Callable[[], frozenset[str]]:
    """Remember the requirements of the installed packages, which are another object once they changed."""
    look_up = run_environment.required_packages
    remembered: list[tuple[object, frozenset[str]]] = []

    def required_packages() -> frozenset[str]:
        installed = run_environment._installed_packages()
        if not remembered or remembered[-1][0] is not installed:
            remembered[:] = [(installed, look_up())]
        return remembered[-1][1]

    return required_packages


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


def _fault_models() -> Callable[[Path], FaultModels]:
    """Remember the fault models of the last templates folder while it has the same files. Without links in
    it, none can lead out of it."""
    look_up = workspace.load_fault_models
    remembered: dict[object, FaultModels] = {}

    def load_fault_models(folder: Path) -> FaultModels:
        key = _plain_files(folder)
        if key is None:
            return look_up(folder)
        if key not in remembered:
            models = fault_model_files._load_all(folder)
            remembered.clear()
            remembered[key] = models
        return remembered[key]

    return load_fault_models


def _plain_files(folder: Path) -> object:
    """Return what changes with each file of a templates folder; None if one is a link or large, because then
    the harness must check it."""
    files = []
    try:
        with os.scandir(folder) as entries:
            for entry in entries:
                state = entry.stat(follow_symlinks=False)
                if stat.S_ISREG(state.st_mode) and state.st_size < _SMALL:
                    files.append((entry.name, state.st_ino, state.st_size, state.st_mtime_ns))
                elif not stat.S_ISDIR(state.st_mode):
                    return None
    except OSError:
        return None
    return folder, tuple(sorted(files))
