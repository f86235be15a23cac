"""The process of a bench's worker, which stays between batches with its engine and what it has loaded.

`python -m mutator.execution.bench_worker FD FILE` reads its assignment from the open file FILE. Over the
connection FD, it sends a `WorkEnding` when it is ready, and receives assignments of experiments; for each, it
sends records, then a `WorkEnding`.
"""

import signal
import sys
from contextlib import suppress
from multiprocessing.connection import Connection

from mutator._common.files import raising_disk_full
from mutator.execution.bench_messages import AssignedExperiments, WorkEnding
from mutator.execution.worker import Worker, WorkerOfProcess, WorkerStart
from mutator.execution.worker_problems import describe_problem
from mutator.execution.worker_processes import opened_by_parent


def _run_assigned(connection: Connection, worker: Worker, assigned: AssignedExperiments) -> WorkEnding:
    try:
        with raising_disk_full(worker.folder.path):
            worker.add_inputs(goldens=assigned.golden_digests, scenario_files=assigned.scenario_files)
            run = worker.prove_experiments if assigned.is_proof else worker.run_experiments
            for record in run(assigned.experiments):
                connection.send(record)
    except Exception as err:
        return WorkEnding(problem=describe_problem(err))
    return WorkEnding()


def _serve(connection: Connection, process: WorkerOfProcess) -> None:
    try:
        worker = process.ensure_worker()
    except Exception as err:
        connection.send(WorkEnding(problem=describe_problem(err)))
        return
    connection.send(WorkEnding())
    try:
        while (assigned := connection.recv()) is not None:
            connection.send(_run_assigned(connection, worker, assigned))
    finally:
        written = process.close()
    connection.send(WorkEnding(written=written))


def main() -> int:
    connection, data = opened_by_parent(sys.argv[1:])
    process = WorkerOfProcess(WorkerStart.from_bytes(data))
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    with suppress(EOFError, BrokenPipeError):
        _serve(connection, process)
    return 0


if __name__ == "__main__":
    sys.exit(main())
