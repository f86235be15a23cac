"""A worker's side of a run: the bundle on its disk, and the processes that run its pieces.

One thread attends a host for the whole run and starts the processes. When that thread ends, the kernel kills
the processes, and the host's folder is deleted. Other threads pass pieces to the host.
"""

import queue
import shutil
import signal
import subprocess
import tempfile
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field, replace
from multiprocessing.connection import Connection
from pathlib import Path

from mutator._common.files import raising_disk_full, remove_folder
from mutator._common.resource_shortages import find_shortage
from mutator.errors import MutatorError, PieceNoLongerNeeded
from mutator.execution.cluster import bundle
from mutator.execution.cluster.piece_messages import Piece, PieceEnding, PieceResult
from mutator.execution.cluster.unpacked_bundle import UnpackedBundle
from mutator.execution.worker_processes import start_worker_process

_CHECK_INTERVAL_S = 0.25  # between two checks that the work is still wanted
_LEAVE_TIMEOUT_S = 5.0  # to kill the processes and delete the folder
_START_TIMEOUT_S = 60.0  # time for a process to begin its first piece
_PIECE_PROCESS_MODULE = "mutator.execution.cluster.piece_process"

PieceNeededCheck = Callable[[], bool]


@dataclass
class _PieceProcess:
    """A process that runs pieces one after another."""

    process: subprocess.Popen[bytes]
    connection: Connection

    def run_piece(
        self, data: bytes, piece: Piece, patience_s: float, is_wanted: PieceNeededCheck
    ) -> PieceResult:
        """Run a piece. Raises PieceNoLongerNeeded if it is no longer wanted; the process is then unusable."""
        finished_ids: set[str] = set()
        try:
            result = self._receive_result(data, patience_s, is_wanted, finished_ids)
        except TimeoutError:
            text = f"a worker's process gave no sign of life for {patience_s:.0f} s"
            result = PieceResult(number=piece.number, ending=PieceEnding.PROCESS_DIED, reason=text)
        except (EOFError, OSError):
            text = f"a worker's process {self._describe_end()}"
            result = PieceResult(number=piece.number, ending=PieceEnding.PROCESS_DIED, reason=text)
        return replace(
            result,
            running_experiment=next((name for name in piece.experiment_ids if name not in finished_ids), ""),
        )

    def _receive_result(
        self, data: bytes, patience_s: float, is_wanted: PieceNeededCheck, finished_ids: set[str]
    ) -> PieceResult:
        """Return the result of a piece; add to `finished_ids`. TimeoutError after `patience_s`."""
        self.connection.send_bytes(data)
        since = time.monotonic()
        while time.monotonic() - since < patience_s:
            if not is_wanted():
                raise PieceNoLongerNeeded
            if self.connection.poll(_CHECK_INTERVAL_S):
                message = self.connection.recv()
                if isinstance(message, bytes):
                    return PieceResult.from_bytes(message)
                finished_ids.add(message)
                since = time.monotonic()
        raise TimeoutError

    def kill(self) -> None:
        """Kill the process. Everything that it started dies with it."""
        self.connection.close()
        self.process.kill()
        self.process.wait()

    def _describe_end(self) -> str:
        with suppress(subprocess.TimeoutExpired):
            code = self.process.wait(5.0)
            return f"was killed by {signal.Signals(-code).name}" if code < 0 else f"left with status {code}"
        return "closed its connection"


@dataclass
class WorkerHost:
    """A worker's part in one run. `worker_name` is the worker's name in the timings of its experiments."""

    folder: Path
    worker_name: str
    patience_s: float
    _idle_processes: list[_PieceProcess] = field(default_factory=list)
    _process_requests: "queue.Queue[queue.Queue[_PieceProcess | Exception]]" = field(
        default_factory=queue.Queue
    )
    _lock: threading.Lock = field(default_factory=threading.Lock)
    _has_ended: bool = False  # if set, no process is started or reused
    _is_leaving: bool = False
    _packed_inputs: bytes = b""  # what each process gets
    _folder_deleted: threading.Event = field(default_factory=threading.Event)

    @classmethod
    def unpack_in(cls, data: bytes, parent_folder: str, worker_name: str) -> "WorkerHost":
        """Make a host for the bundle `data` in a new folder; MutatorError for a damaged bundle."""
        with raising_disk_full(Path(parent_folder)):
            Path(parent_folder).mkdir(parents=True, exist_ok=True)
            folder = Path(tempfile.mkdtemp(prefix="mutator-", dir=parent_folder)).resolve()
        try:
            bundle.unpack_bundle(data, folder)
            # twice: before a sign of life, a golden run or a failed fork can precede the run
            patience_s = 2.0 * UnpackedBundle(folder).limits.wall_s + _START_TIMEOUT_S
        except BaseException:
            remove_folder(folder)
            raise
        return cls(folder, worker_name, patience_s)

    def add_growth(self, data: bytes) -> None:
        """Add golden runs and scenarios that a bench has needed since; MutatorError for a damaged parcel."""
        bundle.unpack_growth(data, self.folder)

    def start_processes_on_request(self, is_wanted: PieceNeededCheck) -> None:
        """Start processes on request until the host is no longer wanted, then end all of them."""
        try:
            while is_wanted() and not self._is_leaving:
                with suppress(queue.Empty):
                    answer = self._process_requests.get(timeout=_CHECK_INTERVAL_S)
                    try:
                        answer.put(self._start_process())
                    except Exception as err:
                        answer.put(err)
        finally:
            with self._lock:
                self._has_ended = True
                idle, self._idle_processes = self._idle_processes, []
            for child in idle:
                child.kill()
            shutil.rmtree(self.folder, ignore_errors=True)
            remove_folder(self.folder)
            self._folder_deleted.set()

    def leave_run(self) -> None:
        self._is_leaving = True
        self._folder_deleted.wait(_LEAVE_TIMEOUT_S)

    def run_piece(self, data: bytes, is_wanted: PieceNeededCheck) -> PieceResult:
        """Run a piece. PieceNoLongerNeeded if it is no longer wanted, MutatorError if `data` is damaged."""
        piece = Piece.from_bytes(data)
        try:
            child = self._borrow_process()
        except (OSError, MutatorError) as err:
            text = str(err if isinstance(err, MutatorError) else find_shortage(err) or err)
            return PieceResult(number=piece.number, ending=PieceEnding.WORKER_UNFIT, reason=text)
        keep = False
        try:
            result = child.run_piece(data, piece, self.patience_s, is_wanted)
            # after any other ending, the process lacks something or may be damaged
            keep = result.ending in (PieceEnding.FINISHED, PieceEnding.GOLDEN_DIFFERS)
            return result
        finally:
            with self._lock:
                keep = keep and not self._has_ended
                if keep:
                    self._idle_processes.append(child)
            if not keep:
                child.kill()

    def _borrow_process(self) -> _PieceProcess:
        """Return an idle process or a new one. Raises PieceNoLongerNeeded if the host has ended."""
        with self._lock:
            if self._idle_processes:
                return self._idle_processes.pop()
        answer: queue.Queue[_PieceProcess | Exception] = queue.Queue()
        self._process_requests.put(answer)
        while not self._has_ended:
            with suppress(queue.Empty):
                process_or_error = answer.get(timeout=_CHECK_INTERVAL_S)
                if isinstance(process_or_error, Exception):
                    raise process_or_error
                return process_or_error
        raise PieceNoLongerNeeded

    def _start_process(self) -> _PieceProcess:
        """Start a process that dies with this thread."""
        self._packed_inputs = (
            self._packed_inputs or bundle.load_run_inputs(UnpackedBundle(self.folder)).to_bytes()
        )
        arguments = [str(self.folder), self.worker_name]
        return _PieceProcess(
            *start_worker_process(_PIECE_PROCESS_MODULE, self._packed_inputs, arguments, folder=self.folder)
        )
