"""Report a session's progress while it runs."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

from mutator.execution.session import Session
from mutator.preflight import equivalence_check
from mutator.store.records import PROOF_FOLDER, RECORDS_FOLDER
from mutator.store.run_progress import Progress, RecordTail

_NOTIFY_INTERVAL_S = 0.5  # a live bar needs no more, and each poll reads files


@contextmanager
def reporting_progress(session: Session) -> Iterator[None]:
    stages = _progress_stages(session)
    stop = threading.Event()

    def follow() -> None:
        while not stop.wait(_NOTIFY_INTERVAL_S):
            session.notify(replace(next(stages), detail=_describe_detail(session)))

    thread = threading.Thread(target=follow, daemon=True)
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join()
        session.notify(next(stages))


def _describe_detail(session: Session) -> str:
    return ", ".join(filter(None, (session.workers_note, session.checks.describe_progress())))


def _progress_stages(session: Session) -> Iterator[Progress]:
    """Yield the current progress: of the experiments until all have a record, then of the proof."""
    folder = session.folder
    experiments = RecordTail("experiments", folder.path, RECORDS_FOLDER, folder.planned_experiment_count)
    while (progress := experiments.poll()).done < progress.total:
        yield progress
    yield progress
    proof = RecordTail(
        "proof", folder.path, PROOF_FOLDER, len(equivalence_check.sample_ids_in_folder(folder))
    )
    while session.proof:
        yield proof.poll()
    while True:
        yield experiments.poll()
