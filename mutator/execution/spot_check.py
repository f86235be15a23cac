"""Spot-check a run: rerun randomly drawn experiments on the reference engine, and compare the records."""

from collections.abc import Iterator, Sequence
from random import SystemRandom

from mutator._common.confined_files import path_below
from mutator._common.files import ScratchFolder
from mutator.errors import MutatorError
from mutator.execution.single_run import manifest_of_unchanged_target, run_single
from mutator.model import Status
from mutator.preflight import equivalence_check
from mutator.store import plan_file
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace


def draw_experiment_ids(folder: RunFolder, count: int) -> list[str]:
    """Draw the ids of `count` experiments that have a result, or of all if there are fewer.

    The draw has no seed, so nobody can predict it.
    """
    records = folder.records().values()
    ids = sorted(record.experiment_id for record in records if record.status is not Status.HARNESS_ERROR)
    return SystemRandom().sample(ids, min(count, len(ids)))


def rerun_and_compare(workspace: Workspace, folder: RunFolder, ids: Sequence[str]) -> Iterator[MutatorError]:
    """Rerun these experiments, and yield an error for each whose record differs."""
    manifest, records = manifest_of_unchanged_target(workspace, folder), folder.records()
    experiments = {experiment.id: experiment for experiment in plan_file.load_experiments(folder.path)}
    with ScratchFolder("mutator-verify-") as scratch:
        for name in ids:
            experiment = experiments[name]
            golden = folder.golden_folder_of(experiment)
            single = run_single(
                workspace,
                manifest,
                experiment,
                path_below(scratch, name),
                limits=folder.limits,
                golden=golden if golden.is_dir() else None,
            )
            stored, rerun_record = records[name], single.record
            if stored != rerun_record:
                yield MutatorError(
                    f"{name} rerun: {equivalence_check.describe_difference(rerun_record, stored)}",
                    where=folder.path,
                    expected="the record of the campaign",
                )
