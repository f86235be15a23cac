"""A worker's side of a run: the bundle on its disk, and the processes that run its pieces.

One thread attends a host for the whole run and starts the processes. When that thread ends, the kernel kills
the processes, and the host's folder is deleted. Other threads pass pieces to the host.
"""

import os
import queue
import shutil
import signal
import socket
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
from mutator.errors import MutatorError, PieceNotWanted
from mutator.execution.cluster import bundle
from mutator.execution.cluster.pieces import Ending, Piece, Result
from mutator.execution.cluster.unpacked_bundle import Site
from mutator.execution.worker import dying_python

_LOOK_S = 0.25  # between two checks that the work is still wanted
_END_S = 5.0
_START_S = 60.0  # time for a process to begin its first piece
_CHILD = "mutator.execution.cluster.piece_process"

Wanted = Callable[[], bool]


@dataclass
class _Child:
    """A process that runs pieces one after another."""

    process: subprocess.Popen[bytes]
    connection: Connection

    def run(self, data: bytes, piece: Piece, patience_s: float, wanted: Wanted) -> Result:
        """Run a piece. Raises PieceNotWanted if it is no longer wanted; the process is then unusable."""
        finished: set[str] = set()
        try:
            result = self._answer(data, patience_s, wanted, finished)
        except TimeoutError:
            text = f"a worker's process gave no sign of life for {patience_s:.0f} s"
            result = Result(number=piece.number, ending=Ending.DIED, text=text)
        except (EOFError, OSError):
            text = f"a worker's process {self._end()}"
            result = Result(number=piece.number, ending=Ending.DIED, text=text)
        return replace(result, at=next((name for name in piece.ids if name not in finished), ""))

    def _answer(self, data: bytes, patience_s: float, wanted: Wanted, finished: set[str]) -> Result:
        """Return the result of a piece; add finished ids to `finished`. TimeoutError after `patience_s`."""
        self.connection.send_bytes(data)
        since = time.monotonic()
        while time.monotonic() - since < patience_s:
            if not wanted():
                raise PieceNotWanted
            if self.connection.poll(_LOOK_S):
                said = self.connection.recv()
                if isinstance(said, bytes):
                    return Result.of(said)
                finished.add(said)
                since = time.monotonic()
        raise TimeoutError

    def end(self) -> None:
        """Kill the process. Everything that it started dies with it."""
        self.connection.close()
        self.process.kill()
        self.process.wait()

    def _end(self) -> str:
        with suppress(subprocess.TimeoutExpired):
            code = self.process.wait(5.0)
            return f"was killed by {signal.Signals(-code).name}" if code < 0 else f"left with status {code}"
        return "closed its connection"


@dataclass
class Host:
    """A worker's part in one run. `name` is the worker's name in the timings of its experiments."""

    folder: Path
    name: str
    patience_s: float
    _idle: list[_Child] = field(default_factory=list)
    _orders: "queue.Queue[queue.Queue[_Child | Exception]]" = field(default_factory=queue.Queue)
    _lock: threading.Lock = field(default_factory=threading.Lock)
    _ended: bool = False  # if set, no process is started or reused
    _leaving: bool = False
    _inputs: bytes = b""  # what each process gets
    _gone: threading.Event = field(default_factory=threading.Event)

    @classmethod
    def lay_out(cls, data: bytes, place: str, name: str) -> "Host":
        """Make a host for the bundle `data` in a new folder in `place`; MutatorError for a damaged bundle."""
        with raising_disk_full(Path(place)):
            Path(place).mkdir(parents=True, exist_ok=True)
            folder = Path(tempfile.mkdtemp(prefix="mutator-", dir=place)).resolve()
        try:
            bundle.lay_out(data, folder)
            patience_s = 2.0 * Site(folder).limits.wall_s + _START_S
        except BaseException:
            remove_folder(folder)
            raise
        return cls(folder, name, patience_s)

    def attend(self, wanted: Wanted) -> None:
        """Start processes on request until the host is no longer wanted, then end all of them."""
        try:
            while wanted() and not self._leaving:
                with suppress(queue.Empty):
                    answer = self._orders.get(timeout=_LOOK_S)
                    try:
                        answer.put(self._started())
                    except Exception as err:
                        answer.put(err)
        finally:
            with self._lock:
                self._ended = True
                idle, self._idle = self._idle, []
            for child in idle:
                child.end()
            shutil.rmtree(self.folder, ignore_errors=True)
            remove_folder(self.folder)
            self._gone.set()

    def end(self) -> None:
        self._leaving = True
        self._gone.wait(_END_S)

    def run(self, data: bytes, wanted: Wanted) -> Result:
        """Run a piece. Raises PieceNotWanted if it is no longer wanted, MutatorError if `data` is damaged."""
        piece = Piece.of(data)
        try:
            child = self._borrowed()
        except (OSError, MutatorError) as err:
            text = str(err if isinstance(err, MutatorError) else find_shortage(err) or err)
            return Result(number=piece.number, ending=Ending.UNFIT, text=text)
        keep = False
        try:
            result = child.run(data, piece, self.patience_s, wanted)
            keep = result.ending in (Ending.DONE, Ending.UNLIKE)
            return result
        finally:
            with self._lock:
                keep = keep and not self._ended
                if keep:
                    self._idle.append(child)
            if not keep:
                child.end()

    def _borrowed(self) -> _Child:
        """Return an idle process or a new one. Raises PieceNotWanted if the host has ended."""
        with self._lock:
            if self._idle:
                return self._idle.pop()
        answer: queue.Queue[_Child | Exception] = queue.Queue()
        self._orders.put(answer)
        while not self._ended:
            with suppress(queue.Empty):
                got = answer.get(timeout=_LOOK_S)
                if isinstance(got, Exception):
                    raise got
                return got
        raise PieceNotWanted

    def _started(self) -> _Child:
        """Start a process that dies with this thread."""
        self._inputs = self._inputs or bundle.read_inputs(Site(self.folder)).to_bytes()
        ours, its = socket.socketpair()
        try:
            with tempfile.TemporaryFile(dir=self.folder) as file:  # nameless, so no run can change it
                file.write(self._inputs)
                file.seek(0)
                descriptors = [its.fileno(), file.fileno()]
                words = ["-m", _CHILD, *map(str, descriptors), str(self.folder), self.name]
                process = subprocess.Popen(
                    [*dying_python(os.getpid()), *words],
                    pass_fds=descriptors,
                    cwd=self.folder,
                    stdin=subprocess.DEVNULL,
                    start_new_session=True,  # signals from the worker's terminal are for the worker only
                )
        except BaseException:
            ours.close()
            raise
        finally:
            its.close()
        return _Child(process, Connection(ours.detach()))
