"""Audit what a run says about golden runs that have a hazard: which these are, and what was left out."""

from collections.abc import Iterator, Sequence

from mutator._common.confined_files import path_below
from mutator.audit.record_audit import StoredRecord
from mutator.errors import MutatorError
from mutator.model import Status
from mutator.outcomes.hazard_and_metric_judgement import load_judged_run
from mutator.store import plan_file
from mutator.store.checks_file import CHECKS_FILE
from mutator.store.run_folder import RunFolder
from mutator.targets.manifest import TargetManifest


def golden_hazard_problems(folder: RunFolder, manifest: TargetManifest) -> Iterator[MutatorError]:
    """Yield golden runs of which checks.json has other hazards than their traces."""
    if not (folder.path / CHECKS_FILE).is_file():
        return
    stored = folder.golden_hazards
    for golden_run in folder.kept_goldens:
        _, judged = load_judged_run(manifest, path_below(folder.path / "golden", golden_run.key))
        hazards = tuple(sorted(judged.hazards, key=lambda hazard: (hazard[1], hazard[0])))
        if stored.get(golden_run.key, ()) != hazards:
            yield MutatorError(
                f"hazards {stored.get(golden_run.key, ())} of golden run {golden_run.key}",
                where=folder.path / CHECKS_FILE,
                expected=f"{hazards}, as in its trace",
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
