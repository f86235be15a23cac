"""Audit what a run says about golden runs that have a hazard: which these are, and what was left out."""

from collections.abc import Iterator, Sequence

from mutator._common.confined_files import path_below
from mutator.audit.record_audit import StoredRecord
from mutator.errors import MutatorError
from mutator.model import Status
from mutator.outcomes.hazard_and_metric_judgement import load_judged_run
from mutator.store import plan_file
from mutator.store.checks_file import CHECKS_FILE
from mutator.store.golden_verdicts import load_golden_verdicts
from mutator.store.planned_scenarios import planned_scenarios_of
from mutator.store.run_folder import RunFolder
from mutator.targets.manifest import TargetManifest


def golden_hazard_problems(folder: RunFolder, manifest: TargetManifest) -> Iterator[MutatorError]:
    """Yield golden runs of which checks.json has other hazards than their traces."""
    if not (folder.path / CHECKS_FILE).is_file():
        return
    stored = folder.golden_hazards
    for golden_run in folder.goldens_with_files:
        _, judged = load_judged_run(manifest, path_below(folder.path / "golden", golden_run.key))
        hazards = tuple(sorted(judged.hazards, key=lambda hazard: (hazard[1], hazard[0])))
        if stored.get(golden_run.key, ()) != hazards:
            yield MutatorError(
                f"hazards {stored.get(golden_run.key, ())} of golden run {golden_run.key}",
                where=folder.path / CHECKS_FILE,
                expected=f"{hazards}, as in its trace",
            )


def golden_verdict_problems(folder: RunFolder, manifest: TargetManifest) -> Iterator[MutatorError]:
    """Yield golden runs whose verdict in checks.json is missing, differs from the trace that is kept, or has
    other hazards than `golden_hazards`.
    """
    path = folder.path / CHECKS_FILE
    needs_verdicts = planned_scenarios_of(folder.path) is not None or not folder.head.experiments
    if not path.is_file() or folder.is_bench or not needs_verdicts:
        return
    verdicts, runs_with_trace = load_golden_verdicts(folder), set(folder.goldens_with_files)
    keys = {golden_run.key for golden_run in folder.golden_runs}
    if keys != verdicts.keys():
        yield MutatorError(
            f"{len(verdicts)} verdicts", where=path, expected=f"those of {len(keys)} golden runs"
        )
        return
    for golden_run in folder.golden_runs:
        verdict = verdicts[golden_run.key]
        expected = {}
        if golden_run in runs_with_trace:
            trace, judged = load_judged_run(manifest, path_below(folder.path / "golden", golden_run.key))
            duration_s = float(trace[manifest.time_channel][-1])
            expected = {name: getattr(judged, name) for name in ("t_end", "hazards", "alerts", "metrics")}
            expected["duration_s"] = duration_s
        hazards = tuple(sorted(verdict.hazards, key=lambda hazard: (hazard[1], hazard[0])))
        is_as_listed = folder.golden_hazards.get(golden_run.key, ()) == hazards
        if not is_as_listed or any(getattr(verdict, name) != value for name, value in expected.items()):
            yield MutatorError(
                f"the verdict of golden run {golden_run.key}",
                where=path,
                expected="that of its trace, and the hazards in `golden_hazards`",
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
