"""Finds the lines that golden runs execute, and the types of variables when these lines begin.

Each run is measured once, in a separate process, and cached. What happens before the first observation is
ignored, because no fault can be active then.
"""

import json
import os
import platform
from collections.abc import Mapping, Sequence
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
from mutator.limits import Limits
from mutator.model import Status
from mutator.operators.interchangeable_variables import TypesByName
from mutator.targets.manifest import TargetManifest

# part of each entry's key: a new schema ignores the old entries instead of misreading them
_LINES_SCHEMA, _TYPES_SCHEMA = "lines/1", "types/1"
ExecutedLinesByFile = dict[str, frozenset[int]]  # lines (from 1) by file
TypesByFileAndLine = Mapping[str, Mapping[int, TypesByName]]  # types of variables by file and line (from 1)


@dataclass(frozen=True, slots=True, kw_only=True)
class GoldenRunInputs:
    """The inputs that determine a golden run."""

    scenario: Path
    changes: tuple[str, ...]
    seed: int


def measure_executed_lines(
    manifest: TargetManifest, golden_runs: Sequence[GoldenRunInputs], limits: Limits
) -> list[ExecutedLinesByFile]:
    """Return the lines that each golden run executes, measured unless cached. MutatorError if a run fails."""
    measured = _reports_of_golden_runs(manifest, golden_runs, limits, _LINES_SCHEMA)
    return [{file: frozenset(lines) for file, lines in run.items()} for run in measured]


def measure_variable_types(
    manifest: TargetManifest, golden_runs: Sequence[GoldenRunInputs], limits: Limits
) -> TypesByFileAndLine:
    """Return the types of variables in golden runs, measured unless cached. MutatorError if a run fails.

    A variable counts on a line if it is bound in each run that executes the line; its types are those of all.
    """
    types_by_file: dict[str, dict[int, dict[str, str]]] = {}
    for run in _reports_of_golden_runs(manifest, golden_runs, limits, _TYPES_SCHEMA):
        for file, types_by_line in run.items():
            merged = types_by_file.setdefault(file, {})
            for line, types in types_by_line.items():
                earlier = merged.get(int(line), types)
                both = {name: {earlier[name], types[name]} for name in earlier.keys() & types.keys()}
                merged[int(line)] = {name: " or ".join(sorted(kinds)) for name, kinds in both.items()}
    return types_by_file


def _reports_of_golden_runs(
    manifest: TargetManifest, golden_runs: Sequence[GoldenRunInputs], limits: Limits, schema: str
) -> list[dict[str, Any]]:
    """Return what each golden run reports, by file."""
    reports = [_load_cached(_cache_key(manifest, golden_run, schema)) for golden_run in golden_runs]
    if any(report is None for report in reports):
        with ScratchFolder("mutator-lines-") as scratch:
            (scratch / "work").mkdir()
            engine = ReferenceEngine(manifest, scratch / "work", limits)
            for i, golden_run in enumerate(golden_runs):
                if reports[i] is None:
                    folder = scratch / "work" / f"lines-{i}"
                    by_schema = _run_and_read_reports(engine, golden_run, folder, schema)
                    for name, report in by_schema.items():
                        _save_cached(_cache_key(manifest, golden_run, name), report)
                    reports[i] = by_schema[schema]
    return [report or {} for report in reports]


def _run_and_read_reports(
    engine: ReferenceEngine, golden_run: GoldenRunInputs, folder: Path, schema: str
) -> dict[str, dict[str, Any]]:
    """Return what a golden run reports, by schema: a run that notes types notes the lines, too."""
    job = Job(
        name=folder.name,
        scenario=golden_run.scenario,
        seed=golden_run.seed,
        scenario_changes=golden_run.changes,
        note_executed_lines=schema == _LINES_SCHEMA,
        note_variable_types=schema == _TYPES_SCHEMA,
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
    lines = {_LINES_SCHEMA: dict[str, Any](execution.executed_lines)}
    return lines if schema == _LINES_SCHEMA else {**lines, _TYPES_SCHEMA: dict(execution.variable_types)}


def _cache_key(manifest: TargetManifest, golden_run: GoldenRunInputs, schema: str) -> str:
    arguments = manifest.run_arguments(
        scenario=Path("scenario"), seed=golden_run.seed, out=Path("out"), changes=golden_run.changes
    )
    at = manifest.observation.location
    entry = [manifest.entry_module, arguments, sorted(manifest.env.items()), at]
    scenario = digest(read_bounded(golden_run.scenario))
    return digest([schema, platform.python_version(), manifest.tree.digest, scenario, golden_run.seed, entry])


def _load_cached(key: str) -> dict[str, Any] | None:
    path = cache_layout_and_pruning.cached_executed_lines_folder() / f"{key}.json"
    try:
        data: dict[str, Any] = json.loads(read_bounded(path))
        if data["sum"] == digest([key, data["lines"]]):
            os.utime(path)  # mark as used
            return dict(data["lines"])
    except (OSError, MutatorError, ValueError, KeyError, TypeError, AttributeError):
        pass
    return None


def _save_cached(key: str, report: dict[str, Any]) -> None:
    path = cache_layout_and_pruning.cached_executed_lines_folder() / f"{key}.json"
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_atomic(path, json_bytes({"sum": digest([key, report]), "lines": report}))
    except (OSError, MutatorError):
        return  # an unwritable cache is ignored
