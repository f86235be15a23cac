"""Finds the lines that golden runs execute. Each run is measured once, in a separate process, and cached.

Lines executed before the first observation are ignored, because no fault can be active then.
"""

import json
import os
import platform
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mutator._common import shared_cache
from mutator._common.bounded_reading import read_bounded
from mutator._common.files import ScratchFolder, json_bytes, write_atomic
from mutator._common.hashing import digest
from mutator.engines.engine_jobs import Job
from mutator.engines.reference_engine import ReferenceEngine
from mutator.errors import MutatorError
from mutator.model import Limits, Status
from mutator.targets.manifest import TargetManifest

_SCHEMA = "lines/1"
Executed = dict[str, frozenset[int]]  # lines (from 1) by file


@dataclass(frozen=True, slots=True, kw_only=True)
class GoldenDrive:
    """The inputs that determine a golden run."""

    scenario: Path
    changes: tuple[str, ...]
    seed: int


def lines_of(manifest: TargetManifest, drives: Sequence[GoldenDrive], limits: Limits) -> list[Executed]:
    """Return the lines that each golden run executes, measured unless cached. MutatorError if a run fails."""
    found = [_recalled(_key(manifest, drive)) for drive in drives]
    if any(lines is None for lines in found):
        with ScratchFolder("mutator-lines-") as scratch:
            (scratch / "work").mkdir()
            engine = ReferenceEngine(manifest, scratch / "work", limits)
            for i, drive in enumerate(drives):
                if found[i] is None:
                    found[i] = _measured(engine, drive, scratch / "work" / f"lines-{i}")
                    _remember(_key(manifest, drive), found[i] or {})
    return [lines or {} for lines in found]


def _measured(engine: ReferenceEngine, drive: GoldenDrive, folder: Path) -> Executed:
    job = Job(name=folder.name, scenario=drive.scenario, seed=drive.seed, changes=drive.changes, lines=True)
    execution = engine.execute(job, folder)
    if execution.status is not Status.OK:
        raise MutatorError(
            f"cannot find executed lines: the golden run of {drive.scenario.stem} failed: {execution.detail}",
            where=engine.manifest.path,
            expected="a fault-free run that succeeds",
            remedy="run `mutator check --drive`",
        )
    return {file: frozenset(lines) for file, lines in execution.lines.items()}


def _key(manifest: TargetManifest, drive: GoldenDrive) -> str:
    arguments = manifest.arguments(
        scenario=Path("scenario"), seed=drive.seed, out=Path("out"), changes=drive.changes
    )
    at = manifest.observation.location
    entry = [manifest.entry_module, arguments, sorted(manifest.env.items()), at]
    scenario = digest(read_bounded(drive.scenario))
    return digest([_SCHEMA, platform.python_version(), manifest.tree.digest, scenario, drive.seed, entry])


def _recalled(key: str) -> Executed | None:
    path = shared_cache.of_lines() / f"{key}.json"
    try:
        data: dict[str, Any] = json.loads(read_bounded(path))
        if data["sum"] == digest([key, data["lines"]]):
            os.utime(path)  # mark as used
            return {file: frozenset(lines) for file, lines in data["lines"].items()}
    except (OSError, MutatorError, ValueError, KeyError, TypeError, AttributeError):
        pass
    return None


def _remember(key: str, executed: Executed) -> None:
    lines = {file: sorted(numbers) for file, numbers in executed.items()}
    path = shared_cache.of_lines() / f"{key}.json"
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_atomic(path, json_bytes({"sum": digest([key, lines]), "lines": lines}))
    except (OSError, MutatorError):
        return  # an unwritable cache is ignored
