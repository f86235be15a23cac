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

from mutator._common import cache_layout_and_pruning
from mutator._common.bounded_reading import read_bounded
from mutator._common.files import ScratchFolder, json_bytes, write_atomic
from mutator._common.hashing import digest
from mutator.engines.engine_jobs import Job
from mutator.engines.reference_engine import ReferenceEngine
from mutator.errors import MutatorError
from mutator.model import Limits, Status
from mutator.targets.manifest import TargetManifest

# part of each entry's key: a new schema ignores the old entries instead of misreading them
_SCHEMA = "lines/1"
ExecutedLines = dict[str, frozenset[int]]  # lines (from 1) by file


@dataclass(frozen=True, slots=True, kw_only=True)
class GoldenRunInputs:
    """The inputs that determine a golden run."""

    scenario: Path
    changes: tuple[str, ...]
    seed: int


def measure_executed_lines(
    manifest: TargetManifest, golden_runs: Sequence[GoldenRunInputs], limits: Limits
) -> list[ExecutedLines]:
    """Return the lines that each golden run executes, measured unless cached. MutatorError if a run fails."""
    lines_by_run = [_load_cached(_cache_key(manifest, golden_run)) for golden_run in golden_runs]
    if any(lines is None for lines in lines_by_run):
        with ScratchFolder("mutator-lines-") as scratch:
            (scratch / "work").mkdir()
            engine = ReferenceEngine(manifest, scratch / "work", limits)
            for i, golden_run in enumerate(golden_runs):
                if lines_by_run[i] is None:
                    lines_by_run[i] = _run_and_note_lines(engine, golden_run, scratch / "work" / f"lines-{i}")
                    _save_cached(_cache_key(manifest, golden_run), lines_by_run[i] or {})
    return [lines or {} for lines in lines_by_run]


def _run_and_note_lines(engine: ReferenceEngine, golden_run: GoldenRunInputs, folder: Path) -> ExecutedLines:
    job = Job(
        name=folder.name,
        scenario=golden_run.scenario,
        seed=golden_run.seed,
        scenario_changes=golden_run.changes,
        note_executed_lines=True,
    )
    execution = engine.execute(job, folder)
    if execution.status is not Status.OK:
        raise MutatorError(
            f"cannot find executed lines: the golden run of {golden_run.scenario.stem} failed: "
            f"{execution.detail}",
            where=engine.manifest.path,
            expected="a fault-free run that succeeds",
            remedy="run `mutator check --drive`",
        )
    return {file: frozenset(lines) for file, lines in execution.executed_lines.items()}


def _cache_key(manifest: TargetManifest, golden_run: GoldenRunInputs) -> str:
    arguments = manifest.run_arguments(
        scenario=Path("scenario"), seed=golden_run.seed, out=Path("out"), changes=golden_run.changes
    )
    at = manifest.observation.location
    entry = [manifest.entry_module, arguments, sorted(manifest.env.items()), at]
    scenario = digest(read_bounded(golden_run.scenario))
    return digest(
        [_SCHEMA, platform.python_version(), manifest.tree.digest, scenario, golden_run.seed, entry]
    )


def _load_cached(key: str) -> ExecutedLines | None:
    path = cache_layout_and_pruning.cached_executed_lines_folder() / f"{key}.json"
    try:
        data: dict[str, Any] = json.loads(read_bounded(path))
        if data["sum"] == digest([key, data["lines"]]):
            os.utime(path)  # mark as used
            return {file: frozenset(lines) for file, lines in data["lines"].items()}
    except (OSError, MutatorError, ValueError, KeyError, TypeError, AttributeError):
        pass
    return None


def _save_cached(key: str, executed: ExecutedLines) -> None:
    lines = {file: sorted(numbers) for file, numbers in executed.items()}
    path = cache_layout_and_pruning.cached_executed_lines_folder() / f"{key}.json"
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_atomic(path, json_bytes({"sum": digest([key, lines]), "lines": lines}))
    except (OSError, MutatorError):
        return  # an unwritable cache is ignored
