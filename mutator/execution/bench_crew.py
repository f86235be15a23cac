"""The workers of a bench: processes that stay between batches, and the dealing of experiments to them.

Each worker has a thread here, which starts its process, deals to it, and receives its records. So the workers
go on while the caller of the bench does something else.
"""

import subprocess
import threading
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from queue import SimpleQueue

from mutator.errors import MutatorError
from mutator.execution.bench_messages import AssignedExperiments, WorkEnding
from mutator.execution.pieces import cut_into_pieces, take_piece_for
from mutator.execution.suspended_workers import WorkerContinuer
from mutator.execution.worker import WorkerStart
from mutator.execution.worker_processes import start_worker_process
from mutator.model import Experiment, Record

_WORKER_MODULE = "mutator.execution.bench_worker"
_END_PATIENCE_S = 30.0  # for a worker to close its files

Run = Sequence[Experiment]  # experiments that share a run


@dataclass(frozen=True, slots=True, kw_only=True)
class CrewBatch:
    """Work for the crew: runs, in order, and what their workers must know. `is_proof`: run them for the
    proof.
    """

    runs: Sequence[Run]
    golden_digests: Mapping[str, str]
    scenario_files: Mapping[str, Path]
    is_proof: bool = False


class BenchCrew:
    """Runs batches in `size` processes. `start_of` makes what the worker of a number begins with; `on_record`
    gets each record at once, in another thread; `on_written` gets what a closed worker wrote.
    """

    def __init__(
        self,
        size: int,
        start_of: Callable[[int], WorkerStart],
        on_written: Callable[[str, Mapping[str, str]], None],
        on_record: Callable[[Record], None] = lambda record: None,
    ) -> None:
        self.size = size
        self._start_of, self._on_written, self._on_record = start_of, on_written, on_record
        self._workers: list[_CrewWorker] = []
        self._board = _Board(on_record)
        self._started_count, self._is_stopped = 0, False
        self._continuer: WorkerContinuer | None = None  # while there are workers

    def hand_out(self, batch: CrewBatch) -> None:
        """Give a batch to the workers, and return at once. MutatorError once the crew was stopped."""
        if self._is_stopped:
            raise crew_error(_CLOSED)
        self._remove_dead_workers()
        self._continuer = self._continuer or WorkerContinuer(self._living_pids)
        starting_count = sum(not worker.is_ready.is_set() for worker in self._workers)
        new_count = self._board.add(batch, self.size) - starting_count
        for _ in range(min(new_count, self.size - len(self._workers))):
            self._workers.append(self._start_worker())

    def receive(self) -> Record:
        """Wait for the next record. MutatorError if a worker fails: the others then end what they have begun,
        and all are closed.
        """
        message = self._board.arrived.get()
        if isinstance(message, Record):
            return message
        self.close()
        raise crew_error(message)

    def wait_until_ready(self) -> None:
        """Wait until no worker is starting, which reads the run folder."""
        for worker in self._workers:
            worker.is_ready.wait()

    def use_new_limits(self) -> None:
        """End the workers, which have the limits with which they began. The next batch starts others."""
        self.close()

    def stop(self) -> None:
        """Make the work of another thread fail, and accept no more."""
        self._is_stopped = True
        self._board.fail(_CLOSED)
        for worker in list(self._workers):
            worker.kill()

    def close(self) -> None:
        """End all workers once they have done what they began, and report what they wrote."""
        self._board.end()
        self._await_ends()

    def kill(self) -> None:
        """End all workers at once. Finished lines stay."""
        self._board.end()
        for worker in self._workers:
            worker.kill()
        self._await_ends()

    def _await_ends(self) -> None:
        for worker in self._workers:
            worker.has_ended.wait()
        if self._continuer is not None:
            self._continuer.end()
            self._continuer = None
        workers, self._workers = self._workers, []
        self._board = _Board(self._on_record)
        for worker in workers:
            if worker.written:
                self._on_written(worker.name, worker.written)

    def _living_pids(self) -> list[int]:
        """Return the process ids of the workers; the caller's other child processes are its own affair."""
        processes = [worker.process for worker in list(self._workers)]
        return [process.pid for process in processes if process is not None and process.returncode is None]

    def _start_worker(self) -> "_CrewWorker":
        start = self._start_of(self._started_count)
        self._started_count += 1
        return _CrewWorker(start, self._board)

    def _remove_dead_workers(self) -> None:
        """Forget idle workers that have died. Of one that had work, its thread tells."""
        for worker in list(self._workers):
            if (
                worker.process is not None
                and worker.process.poll() is not None
                and self._board.dismiss(worker)
            ):
                self._workers.remove(worker)


_CLOSED = "the bench was closed"


@dataclass(frozen=True, slots=True)
class _Piece:
    """Runs of a batch that one worker runs."""

    runs: Sequence[Run]
    batch: CrewBatch


class _Board:
    """The pieces that wait for a worker, and what has arrived: records, and the problem that ended the
    work.
    """

    def __init__(self, on_record: Callable[[Record], None]) -> None:
        self.arrived: SimpleQueue[Record | str] = SimpleQueue()
        self._on_record = on_record
        self._waiting_batches: deque[list[_Piece]] = deque()
        self._idle_workers: list[_CrewWorker] = []
        self._is_over = False
        self._changed = threading.Condition()

    def add(self, batch: CrewBatch, worker_count: int) -> int:
        """Add a batch; return how many waiting pieces are too many for the idle workers."""
        pieces = [_Piece(runs, batch) for runs in cut_into_pieces(batch.runs, _golden_key_of, worker_count)]
        with self._changed:
            self._waiting_batches.append(pieces)
            self._changed.notify_all()
            return sum(map(len, self._waiting_batches)) - len(self._idle_workers)

    def take(self, worker: "_CrewWorker") -> _Piece | None:
        """Wait for a piece of the oldest batch; None if the worker has nothing more to do."""
        with self._changed:
            self._idle_workers.append(worker)
            self._changed.wait_for(
                lambda: self._is_over or self._waiting_batches or worker not in self._idle_workers
            )
            if self._is_over or worker not in self._idle_workers:
                return None
            self._idle_workers.remove(worker)
            pieces = self._waiting_batches[0]
            piece = take_piece_for(worker.golden_key, pieces, lambda piece: _golden_key_of(piece.runs[0]))
            worker.golden_key = _golden_key_of(piece.runs[0])
            if not pieces:
                self._waiting_batches.popleft()
            return piece

    def note(self, record: Record) -> None:
        self._on_record(record)
        self.arrived.put(record)

    def dismiss(self, worker: "_CrewWorker") -> bool:
        """Let a worker take nothing more, if it waits for a piece; return whether it does."""
        with self._changed:
            if worker not in self._idle_workers:
                return False
            self._idle_workers.remove(worker)
            self._changed.notify_all()
            return True

    def end(self) -> None:
        """Deal no more."""
        with self._changed:
            self._is_over = True
            self._changed.notify_all()

    def fail(self, problem: str) -> None:
        self.end()
        self.arrived.put(problem)


class _CrewWorker:
    """A worker's process, and the thread that deals to it.

    Linux ends a process with the thread that started it, and the caller's thread can be short-lived.
    """

    def __init__(self, start: WorkerStart, board: _Board) -> None:
        self.name = start.assignment.worker_name
        self.process: subprocess.Popen[bytes] | None = None
        self.is_ready, self.has_ended = threading.Event(), threading.Event()
        self.written: Mapping[str, str] = {}  # the digests of its files, once it has closed them
        self.golden_key: tuple[object, ...] = ()  # of its last run, which it still has in memory
        self.sent_goldens, self.sent_scenarios = set[str](), set[str]()
        self._is_killed, self._lock = False, threading.Lock()
        threading.Thread(target=self._work, args=(start, board), name=self.name, daemon=True).start()

    def kill(self) -> None:
        with self._lock:
            self._is_killed = True
            if self.process is not None:
                self.process.kill()

    def _work(self, start: WorkerStart, board: _Board) -> None:
        try:
            self._start_and_deal(start, board)
        except Exception as err:  # whatever it is, the caller waits for this thread
            self.kill()
            board.fail(f"worker {self.name} failed: {type(err).__name__}: {err}")
        finally:
            self.is_ready.set()
            self.has_ended.set()

    def _start_and_deal(self, start: WorkerStart, board: _Board) -> None:
        try:
            connection = self._start_process(start)
        except (OSError, MutatorError) as err:
            board.fail(f"worker {self.name} could not begin: {err}")
            return
        with connection:
            problem = self._receive_ending(connection, board)
            self.is_ready.set()
            while not problem and (piece := board.take(self)) is not None:
                with suppress(OSError):  # of a dead worker: receiving from it gives the reason
                    connection.send(_assignment(self, piece))
                problem = self._receive_ending(connection, board)
            if problem:
                board.fail(problem)
            self._end_process(connection)

    def _start_process(self, start: WorkerStart) -> Connection:
        """Start a process that dies with this thread."""
        data = start.to_bytes()
        with self._lock:
            if self._is_killed:
                raise MutatorError(_CLOSED)
            self.process, connection = start_worker_process(_WORKER_MODULE, data)
        return connection

    def _receive_ending(self, connection: Connection, board: _Board) -> str:
        """Pass records on until the end of the work; return why it failed, empty if it did not."""
        while isinstance(message := _receive(self, connection), Record):
            board.note(message)
        return message.problem

    def _end_process(self, connection: Connection) -> None:
        assert self.process is not None
        with suppress(EOFError, OSError):
            connection.send(None)
            if connection.poll(_END_PATIENCE_S) and isinstance(message := connection.recv(), WorkEnding):
                self.written = message.written
        self.process.kill()
        self.process.wait()


def crew_error(problem: str) -> MutatorError:
    return MutatorError(
        problem,
        expected="workers that finish what they are given",
        remedy="ask again: what has finished is not repeated",
    )


def _receive(worker: _CrewWorker, connection: Connection) -> Record | WorkEnding:
    try:
        message: Record | WorkEnding = connection.recv()
        return message
    except (EOFError, OSError):
        assert worker.process is not None
        with suppress(subprocess.TimeoutExpired):
            worker.process.wait(5.0)
        return WorkEnding(problem=f"worker {worker.name} died (status {worker.process.returncode})")


def _golden_key_of(run: Run) -> tuple[object, ...]:
    return run[0].scenario, run[0].changes, run[0].seed


def _assignment(worker: _CrewWorker, piece: _Piece) -> AssignedExperiments:
    """Return the worker's next work, with digests and scenarios that were not sent to it before."""
    batch = piece.batch
    goldens = {key: value for key, value in batch.golden_digests.items() if key not in worker.sent_goldens}
    scenarios = {
        name: path for name, path in batch.scenario_files.items() if name not in worker.sent_scenarios
    }
    worker.sent_goldens |= goldens.keys()
    worker.sent_scenarios |= scenarios.keys()
    return AssignedExperiments(
        experiments=tuple(experiment for run in piece.runs for experiment in run),
        golden_digests=goldens,
        scenario_files=scenarios,
        is_proof=batch.is_proof,
    )
