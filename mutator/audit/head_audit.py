"""Audit what run.json and checks.json say: against the library, the plan, the records and the golden runs."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from fnmatch import fnmatchcase
from itertools import islice
from typing import Any

from mutator._common.confined_files import path_below
from mutator._common.files import read_json
from mutator.audit.record_audit import Recorded
from mutator.campaigns.freezing import target_facts
from mutator.campaigns.shared_runs import run_key
from mutator.errors import MutatorError
from mutator.model import Outcome
from mutator.outcomes.golden_comparison import trace_digest
from mutator.store import file_digests, plan_file
from mutator.store.check_results import FILE as CHECKS
from mutator.store.check_results import SCHEMA as CHECKS_SCHEMA
from mutator.store.run_folder import RunFolder
from mutator.store.run_head import HEAD
from mutator.targets.manifest import TargetManifest
from mutator.workspace import Workspace

Problems = Iterator[MutatorError]
_REMEDY = "verify with the library of the run"


def facts_of_target(folder: RunFolder, workspace: Workspace, manifest: TargetManifest) -> Problems:
    """Yield what run.json says about the target and its hazards, but the library does not."""
    keys = {run_key(manifest, experiment) for experiment in plan_file.iterate_experiments(folder.path)}
    follows = replace(folder.head, runs=len(keys), **vars(target_facts(workspace, manifest)))
    for key, found, value in folder.head.differences(follows):
        yield MutatorError(
            f"{key} {short(found)}",
            where=folder.path / HEAD,
            expected=f"{short(value)}, as in the library",
            remedy=_REMEDY,
        )


def seeds_and_sessions(folder: RunFolder) -> Problems:
    """Yield experiments of another seed or reading than run.json states, and records of no session."""
    path = folder.path / plan_file.EXPERIMENTS
    for number, experiment in enumerate(plan_file.iterate_experiments(folder.path), start=1):
        if experiment.seed not in folder.seeds:
            yield MutatorError(
                f"seed {experiment.seed}", where=path, line=number, expected=_of(folder, "seed")
            )
        if experiment.fault.reading != folder.head.reading:
            got = f"reading {experiment.fault.reading}"
            yield MutatorError(got, where=path, line=number, expected=_of(folder, "reading"))
    if folder.head.choices.reading not in (None, folder.head.reading):
        got = f"choice of the reading {folder.head.choices.reading}"
        yield MutatorError(got, where=folder.path / HEAD, expected=_of(folder, "reading"))
    patterns = [stretch.records for stretch in folder.stretches]
    for name in file_digests.list_segments(folder.path):
        stem = name.partition("/")[2].removesuffix(".jsonl")
        if not any(fnmatchcase(stem, pattern) for pattern in patterns):
            yield MutatorError(
                "records of no session",
                where=path_below(folder.path, name),
                expected=f"a stretch of work in {HEAD}",
            )


def chunks_of(folder: RunFolder) -> tuple[plan_file.Chunk, ...]:
    """Return the offset, length and number of experiments of each chunk, for the numbers in run.json."""
    lines = plan_file.read_lines(folder.path / plan_file.EXPERIMENTS)
    found, offset = [], 0
    for *_, count in folder.head.chunks:
        length = sum(map(len, islice(lines, count)))
        found.append((offset, length, count))
        offset += length
    return tuple(found)


def checks(folder: RunFolder) -> Problems:
    """Yield golden runs of the plan that checks.json does not name, and packages without a version."""
    path = folder.path / CHECKS
    if not path.exists():  # no experiment has run yet
        return
    said = read_json(path, CHECKS_SCHEMA)
    known = {result["name"] for result in said["results"]}
    keys = [one.key for one in folder.golden_runs]
    wanted = ["anchors", "canary", *(f"{kind} {key}" for key in keys for kind in ("golden", "null mutant"))]
    if missing := [name for name in wanted if name not in known]:
        yield MutatorError(f"no check `{missing[0]}`", where=path, expected="the checks of all golden runs")
    if {*said["goldens"]} != {*keys}:
        yield MutatorError(
            f"golden runs {', '.join(said['goldens'])}",
            where=path,
            expected=f"those of {HEAD}, {', '.join(keys)}",
        )
    versions = {name for stretch in folder.stretches for name in stretch.packages}
    if folder.stretches and (lost := sorted({*said.get("packages", ())} - versions)):
        yield MutatorError(
            f"the golden runs loaded {lost[0]}",
            where=path,
            expected=f"its version in a stretch of work in {HEAD}",
        )


def idle_runs(folder: RunFolder, manifest: TargetManifest, records: Sequence[Recorded]) -> Problems:
    """Yield golden runs with other bytes than the runs in which no fault was active, which do the same."""
    idle: dict[str, list[Recorded]] = {}
    experiments = {experiment.id: experiment for experiment in plan_file.iterate_experiments(folder.path)}
    for one in records:
        planned = experiments.get(one.record.experiment_id)
        if planned is not None and one.record.outcome is Outcome.NOT_ACTIVATED:
            idle.setdefault(folder.golden_run_of(planned).key, []).append(one)
    for golden in folder.golden_runs:
        if golden.key not in idle:
            continue
        found = trace_digest(manifest, folder.golden_folder(*golden))
        others = [one for one in idle.get(golden.key, ()) if one.record.trace_digest != found]
        if others:
            yield others[0].difference(
                f"trace {others[0].record.trace_digest[:16]} without an active fault",
                f"that of the golden run {golden.key}, {found[:16]}",
            )


def engines(folder: RunFolder, records: Sequence[Recorded]) -> Problems:
    """Yield an experiment of which nothing says how it ran, if there is no proof."""
    if not folder.is_finished or (folder.path / "proof").is_dir():
        return
    known = folder.timings()
    lost = [one for one in records if one.record.experiment_id not in known]
    if lost:
        yield lost[0].difference(
            "neither a proof nor a line in timings/",
            "a line that names the engine, which decides on the proof",
        )


def _of(folder: RunFolder, key: str) -> str:
    return f"{key} {getattr(folder.head, key)}, as in {HEAD}"


def short(value: Any) -> str:
    """Return the beginning of a value, as text for a message."""
    text = ", ".join(value) if isinstance(value, Mapping) else str(value)
    return text if len(text) <= 80 else f"{text[:80]}..."
