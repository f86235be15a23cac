"""The process of a bench's worker, which stays between batches with its engine and what it has loaded.

`python -m mutator.execution.bench_worker FD FILE` reads its assignment from the open file FILE. Over the
connection FD, it sends a `WorkEnding` when it is ready, and receives assignments of experiments; for each, it
sends records, then a `WorkEnding`.
"""

import os
import pickle
import signal
import sys
import traceback
from contextlib import suppress
from multiprocessing.connection import Connection

from mutator._common.files import raising_disk_full
from mutator._common.folder_locks import open_worker_lock
from mutator._common.resource_shortages import find_shortage
from mutator.campaigns.run_inputs import RunInputs
from mutator.errors import MutatorError
from mutator.execution.bench_messages import AssignedExperiments, BenchWorkerStart, WorkEnding
from mutator.execution.suspended_workers import on_resume
from mutator.execution.worker import Worker, bind_to_parent


def _run_assigned(connection: Connection, worker: Worker, assigned: AssignedExperiments) -> WorkEnding:
    try:
        with raising_disk_full(worker.folder.path):
            worker.add_inputs(goldens=assigned.golden_digests, scenario_files=assigned.scenario_files)
            run = worker.prove_experiments if assigned.is_proof else worker.run_experiments
            for record in run(assigned.experiments):
                connection.send(record)
    except Exception as err:
        return _ending_of_error(err)
    return WorkEnding()


def _ending_of_error(err: Exception) -> WorkEnding:
    reported_error = err if isinstance(err, MutatorError) else find_shortage(err)
    if reported_error:
        return WorkEnding(problem=str(reported_error))
    return WorkEnding(problem="".join(traceback.format_exception(err)).rstrip())


def _serve(connection: Connection, start: BenchWorkerStart) -> None:
    registration = open_worker_lock(start.assignment.run_folder)
    try:
        worker = Worker(RunInputs.from_bytes(start.inputs), start.assignment)
    except Exception as err:
        connection.send(_ending_of_error(err))
        return

    def note_suspension() -> None:
        worker.was_suspended = True

    on_resume(note_suspension)
    connection.send(WorkEnding())
    try:
        while (assigned := connection.recv()) is not None:
            connection.send(_run_assigned(connection, worker, assigned))
    finally:
        worker.close()
        os.close(registration)
    connection.send(WorkEnding(written=dict(worker.file_digests)))


def main() -> int:
    connection = Connection(int(sys.argv[1]))
    with os.fdopen(int(sys.argv[2]), "rb") as file:
        start: BenchWorkerStart = pickle.load(file)
    assert start.assignment.parent_pid is not None
    bind_to_parent(start.assignment.parent_pid)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    with suppress(EOFError, BrokenPipeError):
        _serve(connection, start)
    return 0


if __name__ == "__main__":
    sys.exit(main())
