"""Audit what a run says about golden runs that have a hazard: which these are, and what was left out."""

from collections.abc import Iterator, Sequence

from mutator.audit.record_audit import StoredRecord
from mutator.errors import MutatorError
from mutator.model import Status
from mutator.outcomes.hazard_and_metric_judgement import load_judged_run
from mutator.outcomes.trace_and_record_loading import trace_digest
from mutator.store import plan_file
from mutator.store.checks_file import CHECKS_FILE
from mutator.store.golden_files import GOLDEN_FOLDER, golden_output_folder
from mutator.store.golden_runs import GoldenRun
from mutator.store.golden_verdicts import GoldenVerdict, load_golden_verdicts
from mutator.store.planned_scenarios import planned_scenarios_of
from mutator.store.run_folder import RunFolder
from mutator.targets.manifest import TargetManifest


def golden_verdict_problems(folder: RunFolder, manifest: TargetManifest) -> Iterator[MutatorError]:
    """Yield golden runs of which checks.json has other hazards, or another verdict, than the trace that is
    kept, and those whose verdict is missing or has other hazards than `golden_hazards`.
    """
    path = folder.path / CHECKS_FILE
    if not path.is_file():
        return
    hazards_by_key, verdicts = folder.golden_hazards, load_golden_verdicts(folder)
    has_families = planned_scenarios_of(folder.path) is not None
    needs_verdicts = not folder.is_bench and (has_families or not folder.head.experiments)
    keys = {golden_run.key for golden_run in folder.golden_runs}
    if needs_verdicts and keys != verdicts.keys():
        yield MutatorError(
            f"{len(verdicts)} verdicts", where=path, expected=f"those of {len(keys)} golden runs"
        )
        needs_verdicts = False  # to compare
    runs_with_files = set(folder.goldens_with_files)
    for golden_run in folder.golden_runs:
        key = golden_run.key
        hazards, verdict = hazards_by_key.get(key, ()), verdicts[key] if needs_verdicts else None
        source = "trace" if golden_run in runs_with_files else "verdict"
        judged = _verdict_of_trace(folder, manifest, golden_run) if source == "trace" else verdict
        if judged is not None and judged.hazards != hazards:
            got, expected = f"hazards {hazards} of golden run {key}", f"{judged.hazards}, as in its {source}"
            yield MutatorError(got, where=path, expected=expected)
        if verdict != judged and needs_verdicts:
            yield MutatorError(f"the verdict of golden run {key}", where=path, expected="that of its trace")


def _verdict_of_trace(folder: RunFolder, manifest: TargetManifest, golden_run: GoldenRun) -> GoldenVerdict:
    output = golden_output_folder(folder.path / GOLDEN_FOLDER, golden_run.key)
    trace, judged = load_judged_run(manifest, output)
    return GoldenVerdict(
        duration_s=float(trace[manifest.time_channel][-1]),
        t_end=judged.t_end,
        hazards=judged.hazards_by_time,
        alerts=judged.alerts,
        metrics=judged.metrics,
        trace_digest="" if golden_run.seed is None else trace_digest(manifest, output),
    )


def left_out_problems(folder: RunFolder, records: Sequence[StoredRecord]) -> Iterator[MutatorError]:
    """Yield experiments that were left out although they had to run, or that ran although they had to be
    left out.
    """
    golden_key_by_id = {
        experiment.id: folder.golden_run_of(experiment).key
        for experiment in plan_file.iterate_experiments(folder.path)
    }
    left_out, with_hazards = folder.left_out_goldens, folder.golden_hazards
    for stored in records:
        record = stored.record
        key = golden_key_by_id.get(record.experiment_id)
        if key is None:
            continue
        if (record.status is Status.LEFT_OUT) != (key in left_out):
            expected = "left_out" if key in left_out else "a run"
            yield stored.difference_error(
                f"status {record.status.value}", f"{expected}, because of its golden run {key}"
            )
        if record.against_golden and key not in with_hazards:
            got = f"compared with hazards of golden ({record.against_golden.value})"
            yield stored.difference_error(got, f"no comparison, because the golden run {key} has no hazard")
