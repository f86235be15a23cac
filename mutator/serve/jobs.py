"""Jobs: command lines that the server queues and runs. They end with the server."""

import os
import queue
import re
import subprocess
import sys
import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import UTC, datetime
from enum import StrEnum
from typing import Any

from mutator.errors import MutatorError
from mutator.execution.phases import count, endings
from mutator.serve.answers import without_places
from mutator.serve.orders import TRIES, Work
from mutator.serve.runs import Absent
from mutator.store.progress import Tail

_KEEPER = "mutator.serve.keeper"
_COLUMNS = "200"  # line width of a job's output; pages wrap the lines
_LOG_BYTES = 100_000  # only the last bytes of a job's output are kept
_MOST_JOBS = 200  # ended jobs to keep, the newest
_MOST_WAITING = 50
_NEWS = ("the same as", "no record to compare", "film: ", "verdict: ", "outcomes: ")
_STYLES = re.compile(r"\x1b\[[0-9;]*[A-Za-z]")  # terminal escape codes
_COUNT = re.compile(r"^([a-z ]+) (\d+)/(\d+)(?:,|$)")
_TRIED = re.compile(r"^experiment +([0-9a-f]{16})$", re.MULTILINE)
_END_S = 30.0  # time for jobs to end when the server ends


class State(StrEnum):
    QUEUED = "queued"
    RUNNING = "running"
    DONE = "done"
    FAILED = "failed"
    CANCELLED = "cancelled"


class Ended(MutatorError):
    """The job has already ended and cannot be cancelled."""


@dataclass(kw_only=True)
class Job:
    """A command line, with its progress and result."""

    id: str
    work: Work
    state: State = State.QUEUED
    progress: float | None = None  # progress of the current stage, from 0 to 1
    message: str = ""
    result: str | None = None
    started: datetime | None = None
    ended: datetime | None = None
    log: bytearray = field(default_factory=bytearray)
    tail: Tail | None = None  # follows the records of a campaign while its experiments run
    hold: int | None = None  # the writing end of the pipe to the job's keeper

    def told(self) -> dict[str, Any]:
        order = self.work.order
        if self.tail is not None and self.state is State.RUNNING:
            now = self.tail.poll()
            self.progress = min(1.0, now.done / max(1, now.total))
            self.message = ", ".join(filter(None, (f"experiments {count(now)}", endings(now.outcomes))))
        facts: dict[str, Any] = {"id": self.id, "kind": order.kind, "title": self.work.title}
        facts |= {name: getattr(order, name, None) for name in ("run", "experiment")}
        facts |= {"state": self.state.value, "progress": self.progress, "message": self.message}
        facts |= {"result": self.result, "started": _time(self.started), "ended": _time(self.ended)}
        return facts

    @property
    def text(self) -> str:
        """The output, without control characters and absolute paths."""
        return _plain(self.log)

    def hear(self, line: bytes) -> None:
        self.log += line
        del self.log[:-_LOG_BYTES]
        text = _plain(line).strip()
        if not text:
            return
        found = _COUNT.match(text)
        self.message, self.tail = text[:500], None
        self.progress = min(1.0, int(found[2]) / max(1, int(found[3]))) if found else None
        if found and found[1] == "experiments" and self.work.folder:
            self.tail = Tail("experiments", self.work.folder / "records", int(found[3]))


class Jobs:
    """The jobs of a server. `report_at` returns the address of a run's report."""

    def __init__(self, at_once: int, report_at: Callable[[Work], str | None]) -> None:
        self._jobs: dict[str, Job] = {}
        self._count = 0
        self._waiting: queue.Queue[Job | None] = queue.Queue()
        self._lock = threading.Lock()
        self._report_at = report_at
        self._closed = False
        self._threads = [threading.Thread(target=self._work, daemon=True) for _ in range(at_once)]
        for thread in self._threads:
            thread.start()

    def submit(self, work: Work) -> Job:
        """Queue a job; MutatorError if too many are waiting."""
        with self._lock:
            if sum(job.state is State.QUEUED for job in self._jobs.values()) >= _MOST_WAITING:
                raise MutatorError(
                    f"{_MOST_WAITING} jobs are waiting", remedy="wait for them, or cancel some"
                )
            self._count += 1
            job = Job(id=str(self._count), work=work)
            self._jobs[job.id] = job
            for name in [name for name, one in self._jobs.items() if one.ended][:-_MOST_JOBS]:
                del self._jobs[name]
        self._waiting.put(job)
        return job

    def all(self) -> list[Job]:
        with self._lock:
            return [*reversed(self._jobs.values())]

    def get(self, name: str) -> Job:
        with self._lock:
            if name in self._jobs:
                return self._jobs[name]
        raise Absent(f"no job '{name}'", expected="the id of a job of this server")

    def cancel(self, name: str) -> None:
        """Cancel a job with all its processes; Ended if the job has already ended."""
        job = self.get(name)
        with self._lock:
            if job.ended:
                raise Ended(f"job {name} has ended ({job.state})")
            self._cancel(job)

    def close(self) -> None:
        """End all jobs, and wait for all their processes."""
        with self._lock:
            self._closed = True
            for job in self._jobs.values():
                if not job.ended:
                    self._cancel(job)
        for _ in self._threads:
            self._waiting.put(None)
        for thread in self._threads:
            thread.join(_END_S)

    def _cancel(self, job: Job) -> None:
        if job.state is State.QUEUED:
            job.ended = datetime.now(UTC)
        job.state, job.message = State.CANCELLED, "cancelled"
        if job.hold is not None:
            os.close(job.hold)
            job.hold = None

    def _work(self) -> None:
        while (job := self._waiting.get()) is not None:
            process = self._started(job)
            if process is not None:
                self._follow(job, process)

    def _started(self, job: Job) -> subprocess.Popen[bytes] | None:
        with self._lock:
            if job.state is not State.QUEUED or self._closed:
                return None
            try:
                watched, job.hold = os.pipe()
            except OSError as err:
                self._fail(job, err)
                return None
            try:
                process = subprocess.Popen(
                    [sys.executable, "-P", "-m", _KEEPER, str(watched), *job.work.words],
                    pass_fds=[watched],
                    env={**os.environ, "COLUMNS": _COLUMNS},
                    stdin=subprocess.DEVNULL,
                    stdout=subprocess.PIPE,
                    stderr=subprocess.STDOUT,
                    start_new_session=True,  # only the server handles Ctrl-C
                )
            except OSError as err:
                os.close(job.hold)
                self._fail(job, err)
                return None
            finally:
                os.close(watched)
            job.state, job.started = State.RUNNING, datetime.now(UTC)
            return process

    def _fail(self, job: Job, err: OSError) -> None:
        job.hold, job.state, job.message = None, State.FAILED, f"cannot be started: {err.strerror}"
        job.ended = datetime.now(UTC)

    def _follow(self, job: Job, process: subprocess.Popen[bytes]) -> None:
        assert process.stdout is not None
        with process.stdout as said:
            for line in iter(lambda: said.readline(_LOG_BYTES), b""):
                with self._lock:
                    if job.state is State.RUNNING:
                        job.hear(line)
        code = process.wait()
        result = self._result(job) if code == 0 else None
        with self._lock:
            if job.state is State.RUNNING:
                job.state = State.DONE if code == 0 else State.FAILED
                job.progress, job.result = 1.0 if code == 0 else job.progress, result
                job.message = _news(job) if code == 0 else _complaint(job)
            job.ended = datetime.now(UTC)
            if job.hold is not None:
                os.close(job.hold)
                job.hold = None

    def _result(self, job: Job) -> str | None:
        if job.work.order.kind == "try":
            tried = _TRIED.search(job.text)
            return f"/{TRIES}/{tried[1]}/plot.svg" if tried and "\nplot: " in job.text else None
        return job.work.result or self._report_at(job.work)


def _plain(data: bytes | bytearray) -> str:
    text = without_places(_STYLES.sub("", data.decode("utf-8", "replace")))
    return "".join(c for c in text if c.isprintable() or c in "\n\t")


def _news(job: Job) -> str:
    lines = job.text.splitlines()
    told = [line for line in lines if line.startswith(_NEWS)]
    return (told or [job.message])[-1]


def _complaint(job: Job) -> str:
    lines = job.text.splitlines()
    errors = [line.removeprefix("error: ") for line in lines if line.startswith("error: ")]
    differs = [line for line in lines if line.startswith("DIFFERS")]
    return (errors or differs or [job.message or "no output"])[-1]


def _time(moment: datetime | None) -> str | None:
    return moment.strftime("%Y-%m-%dT%H:%M:%SZ") if moment else None
