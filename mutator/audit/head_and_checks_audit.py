"""Audit what run.json and checks.json say: against the library, the plan, the records and the golden runs."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from fnmatch import fnmatchcase
from itertools import islice
from typing import Any

from mutator._common.confined_files import path_below
from mutator._common.files import read_json
from mutator.audit.record_audit import StoredRecord
from mutator.campaigns.plan_freezing import collect_target_facts
from mutator.campaigns.shared_runs import run_key
from mutator.errors import MutatorError
from mutator.model import Outcome
from mutator.outcomes.trace_and_record_loading import trace_digest
from mutator.store import file_digests, plan_file
from mutator.store.checks_file import CHECKS_FILE as CHECKS
from mutator.store.checks_file import CHECKS_SCHEMA
from mutator.store.plan_lines import read_plan_lines
from mutator.store.planned_scenarios import planned_scenarios_of
from mutator.store.run_folder import RunFolder
from mutator.store.run_head import HEAD
from mutator.targets.manifest import TargetManifest
from mutator.workspace import Workspace

Problems = Iterator[MutatorError]
_REMEDY = "verify with the library of the run"


def target_fact_problems(folder: RunFolder, workspace: Workspace, manifest: TargetManifest) -> Problems:
    """Yield what run.json says about the target and its hazards, but the library does not."""
    keys = {run_key(manifest, experiment) for experiment in plan_file.iterate_experiments(folder.path)}
    expected_head = replace(folder.head, runs=len(keys), **vars(collect_target_facts(workspace, manifest)))
    for key, stored, value in folder.head.differences(expected_head):
        yield MutatorError(
            f"{key} {shortened_text(stored)}",
            where=folder.path / HEAD,
            expected=f"{shortened_text(value)}, as in the library",
            remedy=_REMEDY,
        )


def seed_and_session_problems(folder: RunFolder) -> Problems:
    """Yield experiments of another seed or reading than run.json states, and records of no session."""
    path = folder.path / plan_file.EXPERIMENTS_FILE
    for number, experiment in enumerate(plan_file.iterate_experiments(folder.path), start=1):
        if experiment.seed not in folder.seeds:
            yield MutatorError(
                f"seed {experiment.seed}",
                where=path,
                line=number,
                expected=_expected_as_in_head(folder, "seed"),
            )
        if experiment.fault.reading != folder.head.reading:
            got = f"reading {experiment.fault.reading}"
            yield MutatorError(got, where=path, line=number, expected=_expected_as_in_head(folder, "reading"))
    if folder.head.choices.reading not in (None, folder.head.reading):
        got = f"choice of the reading {folder.head.choices.reading}"
        yield MutatorError(got, where=folder.path / HEAD, expected=_expected_as_in_head(folder, "reading"))
    patterns = [stretch.records for stretch in folder.session_environments]
    for name in file_digests.list_segments(folder.path):
        stem = name.partition("/")[2].removesuffix(".jsonl")
        if not any(fnmatchcase(stem, pattern) for pattern in patterns):
            yield MutatorError(
                "records of no session",
                where=path_below(folder.path, name),
                expected=f"a stretch of work in {HEAD}",
            )


def recomputed_chunks(folder: RunFolder) -> tuple[plan_file.Chunk, ...]:
    """Return the offset, length and number of experiments of each chunk, for the numbers in run.json."""
    lines = read_plan_lines(folder.path / plan_file.EXPERIMENTS_FILE)
    chunks, offset = [], 0
    for *_, count in folder.head.chunks:
        length = sum(map(len, islice(lines, count)))
        chunks.append((offset, length, count))
        offset += length
    return tuple(chunks)


def check_result_problems(folder: RunFolder) -> Problems:
    """Yield golden runs of the plan that checks.json does not name, and packages without a version."""
    path = folder.path / CHECKS
    if not path.exists():  # no experiment has run yet
        return
    stored = read_json(path, CHECKS_SCHEMA)
    check_names = {result["name"] for result in stored["results"]}
    keys, planned = [golden_run.key for golden_run in folder.golden_runs], planned_scenarios_of(folder.path)
    checked_alone = folder.golden_runs if folder.is_bench else folder.listed_goldens
    expected_names = [
        "anchors",
        *(["canary"] if folder.head.canary and not folder.head.defences else []),
        *(f"{kind} {run.key}" for run in checked_alone for kind in ("golden", "null mutant")),
        *(f"family {name}" for name in (planned.families if planned and not folder.is_bench else ())),
    ]
    if missing := [name for name in expected_names if name not in check_names]:
        yield MutatorError(f"no check `{missing[0]}`", where=path, expected="the checks of all golden runs")
    if {*stored["goldens"]} != {*keys}:
        yield MutatorError(
            f"golden runs {', '.join(stored['goldens'])}",
            where=path,
            expected=f"those of {HEAD}, {', '.join(keys)}",
        )
    versions = {name for stretch in folder.session_environments for name in stretch.packages}
    if folder.session_environments and (unversioned := sorted({*stored.get("packages", ())} - versions)):
        yield MutatorError(
            f"the golden runs loaded {unversioned[0]}",
            where=path,
            expected=f"its version in a stretch of work in {HEAD}",
        )


def not_activated_run_problems(
    folder: RunFolder, manifest: TargetManifest, records: Sequence[StoredRecord]
) -> Problems:
    """Yield golden runs with other bytes than the runs in which no fault was active, which do the same.

    Those that ended at a time have fewer bytes, and are compared with each other.
    """
    idle_by_golden: dict[str, list[StoredRecord]] = {}
    first_that_ended: dict[tuple[str, float], StoredRecord] = {}
    experiments = {experiment.id: experiment for experiment in plan_file.iterate_experiments(folder.path)}
    for stored in records:
        planned = experiments.get(stored.record.experiment_id)
        if planned is not None and stored.record.outcome is Outcome.NOT_ACTIVATED:
            key = folder.golden_run_of(planned).key
            if planned.end_s is None:
                idle_by_golden.setdefault(key, []).append(stored)
                continue
            first = first_that_ended.setdefault((key, planned.end_s), stored).record
            if stored.record.trace_digest != first.trace_digest:
                yield stored.difference_error(
                    f"trace {stored.record.trace_digest[:16]} without an active fault",
                    f"that of {first.experiment_id}, which ended at the same time, {first.trace_digest[:16]}",
                )
    for golden in folder.golden_runs:
        if golden.key not in idle_by_golden:
            continue
        golden_digest = trace_digest(manifest, folder.golden_folder(*golden))
        others = [
            recorded
            for recorded in idle_by_golden.get(golden.key, ())
            if recorded.record.trace_digest != golden_digest
        ]
        if others:
            yield others[0].difference_error(
                f"trace {others[0].record.trace_digest[:16]} without an active fault",
                f"that of the golden run {golden.key}, {golden_digest[:16]}",
            )


def unknown_engine_problem(folder: RunFolder, records: Sequence[StoredRecord]) -> Problems:
    """Yield an experiment of which nothing says how it ran, if there is no proof."""
    if not folder.is_finished or (folder.path / "proof").is_dir():
        return
    timings = folder.timings()
    without_timing = [stored for stored in records if stored.record.experiment_id not in timings]
    if without_timing:
        yield without_timing[0].difference_error(
            "neither a proof nor a line in timings/",
            "a line that names the engine, which decides on the proof",
        )


def _expected_as_in_head(folder: RunFolder, key: str) -> str:
    return f"{key} {getattr(folder.head, key)}, as in {HEAD}"


def shortened_text(value: Any) -> str:
    """Return the beginning of a value, as text for a message."""
    text = ", ".join(value) if isinstance(value, Mapping) else str(value)
    return text if len(text) <= 80 else f"{text[:80]}..."
