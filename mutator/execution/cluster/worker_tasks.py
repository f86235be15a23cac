"""Functions that the command submits to Dask workers by reference.

For each run, the task `attend_run` runs on every worker, outside the thread pool, for as long as the run
lasts. When it ends, the run's processes on that worker are killed, and its files are deleted. Each piece is
a separate task.
"""

import platform
import socket
import threading
import time
from collections.abc import Iterable
from hashlib import sha256
from typing import Any

from distributed import Worker, get_worker, secede
from distributed.core import Status

from mutator._common.hashing import as_json_types
from mutator._common.version import VERSION
from mutator.campaigns import run_environment
from mutator.errors import MutatorError
from mutator.execution.cluster.worker_host import PieceNeededCheck, WorkerHost

_BUNDLE_TIMEOUT_S = 60.0  # how long a piece waits for the bundle of its run

_hosts_by_run: dict[str, WorkerHost] = {}  # by run
_bundle_arrived = threading.Condition()


def machine_facts(packages: Iterable[str]) -> dict[str, Any]:
    """Describe this worker's machine and software, including the versions of these packages."""
    return {
        "mutator": VERSION,
        "host": socket.gethostname(),
        "python": run_environment.python_version(),
        "platform": platform.platform(),
        "cpu": run_environment.processor_name(),
        "blas": as_json_types(run_environment.loaded_blas()),
        "packages": run_environment.package_versions(packages),
    }


def deliver_bundle(run: str, worker_name: str, bundle: bytes, digest: str) -> None:
    _check_digest(bundle, digest)
    host = WorkerHost.unpack_in(bundle, get_worker().local_directory, worker_name)
    with _bundle_arrived:
        _hosts_by_run[run] = host
        _bundle_arrived.notify_all()


def deliver_growth(run: str, growth: bytes, digest: str) -> None:
    """Add what the plan of a bench has needed since the bundle was packed."""
    _check_digest(growth, digest)
    if (host := _hosts_by_run.get(run)) is None:
        raise MutatorError("this worker has left the run", remedy="deliver the bundle again")
    host.add_growth(growth)


def _check_digest(data: bytes, digest: str) -> None:
    if sha256(data).hexdigest() != digest:
        raise MutatorError(
            "the bundle that arrived differs from the one that was sent", remedy="check the network"
        )


def attend_run(run: str) -> None:
    """Take part in a run until the command releases this task or is gone."""
    host, is_wanted = _hosts_by_run[run], _current_task_check()
    secede()
    try:
        host.start_processes_on_request(is_wanted)
    finally:
        with _bundle_arrived:
            if _hosts_by_run.get(run) is host:  # unless the bundle has been delivered again
                del _hosts_by_run[run]


def leave_run(run: str) -> None:
    """Leave a run, and wait until its processes and files on this worker are gone."""
    if (host := _hosts_by_run.get(run)) is not None:
        host.leave_run()


def run_piece(run: str, piece: bytes) -> bytes:
    deadline = time.monotonic() + _BUNDLE_TIMEOUT_S
    with _bundle_arrived:
        while run not in _hosts_by_run:
            if not _bundle_arrived.wait(deadline - time.monotonic()):
                raise MutatorError("the bundle of the run did not arrive", remedy="check the network")
        host = _hosts_by_run[run]
    return host.run_piece(piece, _current_task_check()).to_bytes()


def _current_task_check() -> PieceNeededCheck:
    """Make a function that returns whether this thread's task is wanted and the worker is not closing."""
    worker: Worker = get_worker()
    key = worker.get_current_task()

    def is_wanted() -> bool:
        task = worker.state.tasks.get(key)
        alive = worker.status in (Status.running, Status.paused)
        return alive and task is not None and task.state in ("executing", "long-running")

    return is_wanted
