"""The conditions that the runs before a campaign must meet."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from mutator._common.bounded_reading import read_bounded
from mutator._common.confined_files import path_below
from mutator._common.hashing import digest
from mutator.engines.engine_jobs import JobResult
from mutator.errors import BadOutput
from mutator.model import Status
from mutator.mutants.probe_contract import was_triggered
from mutator.outcomes import trace_and_record_loading
from mutator.outcomes.hazard_and_metric_judgement import load_judged_run
from mutator.outcomes.lost_observed_values import find_value_lost_for_good
from mutator.store.golden_files import read_golden_files
from mutator.store.golden_verdicts import GoldenVerdict
from mutator.targets.manifest import TargetManifest


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckRun:
    """What the checks need from a run.

    `output_digest` covers all outputs; `hazards` are by time; `third_party_modules` are the top-level modules
    that the run imported.
    """

    problem: str
    output_digest: str = ""
    trace_digest: str = ""
    hazards: tuple[tuple[str, float], ...] = ()
    alerts: tuple[tuple[str, float], ...] = ()
    t_end: float | None = None
    metrics: tuple[tuple[str, float], ...] = ()
    duration_s: float = 0.0
    has_triggered: bool = False
    cpu_s: float = 0.0
    third_party_modules: tuple[str, ...] = ()


def read_check_run(manifest: TargetManifest, execution: JobResult) -> CheckRun:
    if execution.status is not Status.OK:
        log = execution.log_tail.strip()
        # the last printed line explains why a run was killed; an exception has its own message
        last = f" ({log.splitlines()[-1]})" if log and execution.exception is None else ""
        return CheckRun(problem=f"{execution.status.value}: {execution.detail}{last}")
    try:
        trace, judged = load_judged_run(manifest, execution.out)
    except BadOutput as err:
        return CheckRun(problem=f"{Path(err.where or '').name}: {err.got}")
    if lost := find_value_lost_for_good(manifest, trace, judged.t_end):
        return CheckRun(problem=f"{lost}, and stays so to the end of the drive")
    return CheckRun(
        problem="",
        output_digest=output_digest_of(manifest, execution.out),
        trace_digest=trace_and_record_loading.trace_digest(manifest, execution.out),
        alerts=judged.alerts,
        hazards=judged.hazards_by_time,
        t_end=judged.t_end,
        metrics=judged.metrics,
        duration_s=float(trace[manifest.time_channel][-1]) if len(trace[manifest.time_channel]) else 0.0,
        has_triggered=was_triggered(execution.probe_report),
        cpu_s=execution.cpu_s,
        third_party_modules=execution.third_party_modules,
    )


def golden_verdict_of(run: CheckRun, *, has_seed: bool) -> GoldenVerdict:
    """Return what checks.json stores of a golden run; `has_seed`: whether its key has a seed."""
    return GoldenVerdict(
        duration_s=run.duration_s,
        t_end=run.t_end,
        hazards=run.hazards,
        alerts=run.alerts,
        metrics=run.metrics,
        trace_digest=run.trace_digest if has_seed else "",
    )


def output_digest_of(manifest: TargetManifest, out: Path) -> str:
    """Digest of trace and record in an output folder; empty if they are missing."""
    try:
        return digest([digest(read_bounded(path_below(out, name))) for name in manifest.output_files])
    except OSError:
        return ""


def golden_output_digest(manifest: TargetManifest, golden: Path, key: str) -> str:
    """Like `output_digest_of`, of a run in the folder `golden`, which can be packed. MutatorError if that is
    damaged.
    """
    files = read_golden_files(golden, key)
    if not files.keys() >= {*manifest.output_files}:
        return ""
    return digest([digest(files[name]) for name in manifest.output_files])


def golden_pair_problem(first: CheckRun, again: CheckRun) -> str:
    """Return the problem of a pair of golden runs; empty if there is none."""
    if first.problem or again.problem:
        return first.problem or again.problem
    if first.output_digest != again.output_digest:
        return "two runs that differ in nothing but PYTHONHASHSEED gave different bytes"
    return ""


def null_mutant_problem(first: CheckRun, null: CheckRun) -> str:
    if null.problem:
        return null.problem
    if null.output_digest != first.output_digest:
        return "the probe alone changes what the target does"
    return "" if null.has_triggered else "its trigger never fired: the observation statement is not executed"


def forked_run_problem(first: CheckRun, forked: CheckRun) -> str:
    """Return the problem of a golden run in a fork of the loaded target; empty if there is none."""
    if forked.problem:
        return forked.problem
    if forked.output_digest != first.output_digest:
        return "a fork of the loaded target gives other bytes than a fresh process"
    return ""


def equal_scenarios_problem(goldens: Mapping[str, CheckRun]) -> str:
    """Return the problem of golden runs (by scenario) that are equal according to the manifest; empty if
    there is none.
    """
    (first, reference), *others = goldens.items()
    for name, run in others:
        if run.problem or reference.problem:
            return run.problem or reference.problem
        if (run.trace_digest, run.alerts) != (reference.trace_digest, reference.alerts):
            return f"{name} differs from {first}, although the manifest says that they are equal (same_in)"
    return ""
