"""The workers of a bench: processes that stay between batches, and the dealing of experiments to them."""

import os
import pickle
import socket
import subprocess
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from multiprocessing.connection import Connection, wait
from pathlib import Path

from mutator._common.interrupts import delaying_interrupts
from mutator.errors import MutatorError
from mutator.execution.bench_messages import AssignedExperiments, BenchWorkerStart, WorkEnding
from mutator.execution.worker import python_command_dying_with
from mutator.model import Experiment, Record

_WORKER_MODULE = "mutator.execution.bench_worker"
_PIECES_PER_WORKER = 4  # of a batch: more even the load, fewer share more work
_MOST_RUNS_PER_PIECE = 20
_END_PATIENCE_S = 30.0  # for a worker to close its files

Run = Sequence[Experiment]  # experiments that share a run


@dataclass
class _CrewWorker:
    """A worker's process. `golden_key`: that of its last experiments, whose run it still has in memory."""

    name: str
    process: subprocess.Popen[bytes]
    connection: Connection
    golden_key: tuple[object, ...] = ()
    sent_goldens: set[str] = field(default_factory=set)
    sent_scenarios: set[str] = field(default_factory=set)

    def kill(self) -> None:
        self.connection.close()
        self.process.kill()
        self.process.wait()


@dataclass
class BenchCrew:
    """Runs experiments in `size` processes. `start_of` makes what the worker of a number begins with."""

    size: int
    start_of: Callable[[int], BenchWorkerStart]
    on_written: Callable[[str, Mapping[str, str]], None]
    _workers: list[_CrewWorker] = field(default_factory=list)
    _started_count: int = 0
    _is_stopped: bool = False
    # Linux ends a process with the thread that started it, and a caller's thread can be short-lived
    _starter: ThreadPoolExecutor = field(default_factory=partial(ThreadPoolExecutor, 1))

    def run(
        self,
        runs: Sequence[Run],
        golden_digests: Mapping[str, str],
        scenario_files: Mapping[str, Path],
        *,
        is_proof: bool = False,
    ) -> Iterator[Record]:
        """Run experiments, and yield each record when it is there.

        MutatorError if a worker fails; the others then end what they have begun, and all are closed.
        """
        dealing = _Dealing(_cut_into_pieces(runs, self.size), golden_digests, scenario_files, is_proof)
        self._start_workers(len(dealing.pieces))
        for worker in self._workers:
            dealing.deal(worker)
        yield from dealing.receive_records()
        if dealing.problems:
            self.close()
            raise _work_error(dealing.problems[0])

    def stop(self) -> None:
        """Make the work of another thread fail, and start no further worker."""
        self._is_stopped = True
        for worker in self._workers:
            worker.process.kill()

    def close(self) -> None:
        """End all workers, and report what they wrote."""
        workers, self._workers = self._workers, []
        for worker in workers:
            with suppress(OSError):
                worker.connection.send(None)
        for worker in workers:
            with suppress(EOFError, OSError):
                while worker.connection.poll(_END_PATIENCE_S):
                    message = worker.connection.recv()
                    if isinstance(message, WorkEnding) and message.written:
                        self.on_written(worker.name, message.written)
                        break
            worker.kill()

    def kill(self) -> None:
        """End all workers at once. Finished lines stay."""
        workers, self._workers = self._workers, []
        for worker in workers:
            worker.kill()

    def end(self) -> None:
        """End all workers and the thread that started them. The crew cannot be used further."""
        self.kill()
        self._starter.shutdown()

    def _start_workers(self, piece_count: int) -> None:
        """Start workers until there is one for each piece, or the crew is complete."""
        self._remove_dead_workers()
        while len(self._workers) < min(self.size, piece_count):
            if self._is_stopped:
                raise _work_error("the bench was closed")
            with delaying_interrupts():  # so that no process is forgotten
                self._workers.append(self._starter.submit(self._start_worker).result())

    def _remove_dead_workers(self) -> None:
        """Forget workers that have died."""
        living = [worker for worker in self._workers if worker.process.poll() is None]
        for worker in self._workers:
            if worker not in living:
                worker.kill()
        self._workers = living

    def _start_worker(self) -> _CrewWorker:
        """Start a process that dies with the thread that calls this."""
        start = self.start_of(self._started_count)
        self._started_count += 1
        here, there = socket.socketpair()
        try:
            with tempfile.TemporaryFile() as file:  # nameless, so no run can change it
                file.write(pickle.dumps(start))
                file.seek(0)
                descriptors = [there.fileno(), file.fileno()]
                process = subprocess.Popen(
                    [*python_command_dying_with(os.getpid()), "-m", _WORKER_MODULE, *map(str, descriptors)],
                    pass_fds=descriptors,
                    stdin=subprocess.DEVNULL,
                    start_new_session=True,  # Ctrl-C is for the command only
                )
        except BaseException:
            here.close()
            raise
        finally:
            there.close()
        return _CrewWorker(start.assignment.worker_name, process, Connection(here.detach()))


@dataclass
class _Dealing:
    """The dealing of `pieces` to workers, until all are done or there are `problems`."""

    pieces: list[list[Run]]
    golden_digests: Mapping[str, str]
    scenario_files: Mapping[str, Path]
    is_proof: bool
    problems: list[str] = field(default_factory=list)
    _busy: dict[Connection, _CrewWorker] = field(default_factory=dict)

    def deal(self, worker: _CrewWorker) -> None:
        if self.pieces and not self.problems:
            piece = _pop_piece_for(worker, self.pieces)
            assigned = _assignment(worker, piece, self.golden_digests, self.scenario_files, self.is_proof)
            with suppress(OSError):  # of a dead worker: receiving from it gives the reason
                worker.connection.send(assigned)
            self._busy[worker.connection] = worker

    def receive_records(self) -> Iterator[Record]:
        while self._busy:
            for connection in wait(list(self._busy)):
                assert isinstance(connection, Connection)
                message = _receive(self._busy[connection])
                if isinstance(message, Record):
                    yield message
                    continue
                worker = self._busy.pop(connection)
                if message.problem:
                    self.problems.append(message.problem)
                self.deal(worker)


def _work_error(problem: str) -> MutatorError:
    return MutatorError(
        problem,
        expected="workers that finish what they are given",
        remedy="ask again: what has finished is not repeated",
    )


def _receive(worker: _CrewWorker) -> Record | WorkEnding:
    try:
        message: Record | WorkEnding = worker.connection.recv()
        return message
    except (EOFError, OSError):
        with suppress(subprocess.TimeoutExpired):
            worker.process.wait(5.0)
        return WorkEnding(problem=f"worker {worker.name} died (status {worker.process.returncode})")


def _golden_key_of(run: Run) -> tuple[object, ...]:
    return run[0].scenario, run[0].changes, run[0].seed


def _cut_into_pieces(runs: Sequence[Run], worker_count: int) -> list[list[Run]]:
    """Cut runs, which are in order, into pieces with one golden run each."""
    most_runs = max(1, min(_MOST_RUNS_PER_PIECE, -(-len(runs) // (worker_count * _PIECES_PER_WORKER))))
    pieces: list[list[Run]] = []
    for run in runs:
        last = pieces[-1] if pieces else []
        if last and len(last) < most_runs and _golden_key_of(last[0]) == _golden_key_of(run):
            last.append(run)
        else:
            pieces.append([run])
    return pieces


def _pop_piece_for(worker: _CrewWorker, pieces: list[list[Run]]) -> list[Run]:
    """Return the next piece with the golden run that the worker has in memory, or else the next one."""
    matching = (i for i, piece in enumerate(pieces) if _golden_key_of(piece[0]) == worker.golden_key)
    piece = pieces.pop(next(matching, 0))
    worker.golden_key = _golden_key_of(piece[0])
    return piece


def _assignment(
    worker: _CrewWorker,
    piece: list[Run],
    golden_digests: Mapping[str, str],
    scenario_files: Mapping[str, Path],
    is_proof: bool,
) -> AssignedExperiments:
    """Return the worker's next work, with digests and scenarios that were not sent to it before."""
    goldens = {key: value for key, value in golden_digests.items() if key not in worker.sent_goldens}
    scenarios = {name: path for name, path in scenario_files.items() if name not in worker.sent_scenarios}
    worker.sent_goldens |= goldens.keys()
    worker.sent_scenarios |= scenarios.keys()
    experiments = tuple(experiment for run in piece for experiment in run)
    return AssignedExperiments(
        experiments=experiments, golden_digests=goldens, scenario_files=scenarios, is_proof=is_proof
    )
