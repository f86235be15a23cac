"""What a session has to prove, and what it proves itself at its end."""

from collections.abc import Callable, Collection, Mapping

from mutator.execution.worker import Worker
from mutator.execution.written_files import FileDigests
from mutator.model import Record
from mutator.preflight import equivalence_check
from mutator.store.planned_experiments import PlannedExperiments
from mutator.store.run_folder import RunFolder


def remaining_proof(
    folder: RunFolder, selected_ids: Collection[str] | None, records: Mapping[str, Record]
) -> tuple[equivalence_check.SampledExperiment, ...]:
    """Return what is to be proved; with `selected_ids`, only of those and of what has a record."""
    remaining = equivalence_check.remaining_sampled_experiments(folder)
    return tuple(s for s in remaining if selected_ids is None or s.id in selected_ids or s.id in records)


def prove_rest_of_sample(
    folder: RunFolder, records: Mapping[str, Record], make_worker: Callable[[], Worker]
) -> FileDigests:
    """Prove, in this process, what is in the sample because other experiments were left out; return the
    digests of the worker's files.

    Workers that begin while the checks run do not know yet which golden runs have a hazard.
    """
    remaining = equivalence_check.remaining_sampled_experiments(folder) if folder.left_out_goldens else ()
    planned = PlannedExperiments(folder.path) if remaining else {}
    experiments = [planned[sampled.id] for sampled in remaining if sampled.id in records]
    if not experiments:
        return {}
    worker = make_worker()
    try:
        for _ in worker.prove_experiments(experiments):
            pass
    finally:
        worker.close()
    return worker.file_digests
