"""Jobs: command lines that the server queues and runs. They end with the server."""

import os
import queue
import re
import selectors
import subprocess
import sys
import threading
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import UTC, datetime
from enum import StrEnum
from pathlib import Path
from typing import IO, Any

from mutator._common.progress_events import EVENTS_FD_VARIABLE
from mutator.errors import JobEnded, MutatorError, NotServed
from mutator.execution.progress_text import describe_outcomes
from mutator.serve.job_events import Event, EventReader, Link, Phase
from mutator.serve.job_requests import TRIES, Work
from mutator.serve.responses import without_places

_GUARD_MODULE = "mutator.serve.job_guard"
_COLUMNS = "200"  # line width of a job's output; pages wrap the lines
_LOG_BYTES = 100_000  # only the last bytes of a job's output are kept
_READ_BYTES = 65_536
_LONGEST_MESSAGE = 500
_MOST_JOBS = 200  # ended jobs to keep, the newest
_MOST_WAITING = 50
_STYLES = re.compile(r"\x1b\[[0-9;]*[A-Za-z]")  # terminal escape codes
_END_S = 30.0  # time for jobs to end when the server ends


class State(StrEnum):
    QUEUED = "queued"
    RUNNING = "running"
    DONE = "done"
    FAILED = "failed"
    CANCELLED = "cancelled"


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
    outcome: str = ""  # what came out of the command, in one sentence
    error: str = ""
    links: dict[str, str] = field(default_factory=dict)  # kind of file -> path
    events: EventReader = field(default_factory=EventReader)
    hold: int | None = None  # the writing end of the pipe to the job's guard

    def told(self) -> dict[str, Any]:
        order = self.work.order
        facts: dict[str, Any] = {"id": self.id, "kind": order.kind, "title": self.work.title}
        facts |= {name: getattr(order, name, None) for name in ("run", "experiment")}
        facts |= {"state": self.state.value, "progress": self.progress, "message": self.message}
        facts |= {"result": self.result, "started": _time(self.started), "ended": _time(self.ended)}
        return facts

    @property
    def text(self) -> str:
        """The output, without control characters and absolute paths."""
        return _plain(self.log)

    def add_output(self, data: bytes) -> None:
        self.log += data
        del self.log[:-_LOG_BYTES]

    def add_events(self, data: bytes) -> None:
        """Take in what the command sent through the pipe for events."""
        for event in self.events.read(data):
            self._add(event)

    def _add(self, event: Event) -> None:
        if isinstance(event, Link):
            self.links[event.kind] = event.path
        elif isinstance(event, Phase):
            count = f" {event.done}/{event.total}" if event.total else ""
            parts = (_line(f"{event.phase}{count}"), describe_outcomes(Counter(event.outcomes)))
            self.message = ", ".join(filter(None, parts))
            self.progress = min(1.0, event.done / event.total) if event.total else None
        elif event.event == "result":
            self.outcome = _line(event.text)
        elif event.event == "error":
            self.error = _line(event.text)
        else:
            self.message = f"warning: {_line(event.text)}"


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
        raise NotServed(f"no job '{name}'", expected="the id of a job of this server")

    def cancel(self, name: str) -> None:
        """Cancel a job with all its processes; JobEnded if the job has already ended."""
        job = self.get(name)
        with self._lock:
            if job.ended:
                raise JobEnded(f"job {name} has ended ({job.state})")
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
            try:
                events, sent = os.pipe()
            except OSError as err:
                with self._lock:
                    self._fail(job, err)
                continue
            with os.fdopen(events, "rb", buffering=0) as pipe:
                try:
                    process = self._started(job, sent)
                finally:
                    os.close(sent)
                if process is not None:
                    self._follow(job, process, pipe)

    def _started(self, job: Job, events: int) -> subprocess.Popen[bytes] | None:
        """Start the job's command, which sends its events to the pipe `events`; None if it must not start."""
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
                    [sys.executable, "-P", "-m", _GUARD_MODULE, str(watched), *job.work.words],
                    pass_fds=[watched, events],
                    env={**os.environ, "COLUMNS": _COLUMNS, EVENTS_FD_VARIABLE: str(events)},
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

    def _follow(self, job: Job, process: subprocess.Popen[bytes], events: IO[bytes]) -> None:
        assert process.stdout is not None
        with process.stdout as output:
            self._read(job, {output.fileno(): job.add_output, events.fileno(): job.add_events})
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

    def _read(self, job: Job, readers: dict[int, Callable[[bytes], None]]) -> None:
        """Give what the job's command writes to its readers, until it has closed all pipes."""
        with selectors.DefaultSelector() as pipes:
            for pipe, reader in readers.items():
                pipes.register(pipe, selectors.EVENT_READ, reader)
            while pipes.get_map():
                for ready, _ in pipes.select():
                    data = os.read(ready.fd, _READ_BYTES)
                    if not data:
                        pipes.unregister(ready.fd)
                    with self._lock:
                        if job.state is State.RUNNING:
                            ready.data(data)

    def _result(self, job: Job) -> str | None:
        if job.work.order.kind == "try":
            plot = job.links.get("plot")
            return f"/{TRIES}/{Path(plot).parent.name}/plot.svg" if plot else None
        return job.work.result or self._report_at(job.work)


def _plain(data: bytes | bytearray) -> str:
    return _printable(data.decode("utf-8", "replace"))


def _printable(text: str) -> str:
    text = without_places(_STYLES.sub("", text))
    return "".join(c for c in text if c.isprintable() or c in "\n\t")


def _line(text: str) -> str:
    return _printable(text)[:_LONGEST_MESSAGE]


def _news(job: Job) -> str:
    film = job.links.get("film")
    return f"film: {_line(film)}" if film else job.outcome or job.message


def _complaint(job: Job) -> str:
    return job.error or job.outcome or job.message or "no output"


def _time(moment: datetime | None) -> str | None:
    return moment.strftime("%Y-%m-%dT%H:%M:%SZ") if moment else None
