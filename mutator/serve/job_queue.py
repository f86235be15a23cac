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

from mutator._common.command_progress_events import EVENTS_FD_VARIABLE, SMALLEST_FORM_LINK
from mutator.errors import JobAlreadyEnded, MutatorError, NotServed
from mutator.execution.progress_text import describe_outcomes
from mutator.serve.http_responses import without_absolute_folders
from mutator.serve.job_event_reading import EventReader, FileEvent, JobEvent, PhaseEvent
from mutator.serve.job_requests import JobCommand
from mutator.serve.served_trials import trial_address

_GUARD_MODULE = "mutator.serve.job_guard"
_OUTPUT_COLUMNS = "200"  # line width of a job's output; pages wrap the lines
_MOST_LOG_BYTES = 100_000  # only the last bytes of a job's output are kept
_READ_CHUNK_BYTES = 65_536  # what a pipe holds in Linux
_MOST_MESSAGE_CHARACTERS = 500
_MOST_ENDED_JOBS = 200  # ended jobs to keep, the newest
_MOST_WAITING_JOBS = 50
_ESCAPE_CODE_PATTERN = re.compile(r"\x1b\[[0-9;]*[A-Za-z]")  # terminal escape codes
_MOST_SHUTDOWN_S = 30.0  # for jobs to end with the server; longer than `job_guard.MOST_CLEANUP_S`


class JobState(StrEnum):
    QUEUED = "queued"
    RUNNING = "running"
    DONE = "done"
    FAILED = "failed"
    CANCELLED = "cancelled"


@dataclass(kw_only=True)
class ServeJob:
    """A command line, with its progress and result."""

    id: str
    job_command: JobCommand
    state: JobState = JobState.QUEUED
    progress: float | None = None  # progress of the current stage, from 0 to 1
    message: str = ""
    result_address: str | None = None
    started: datetime | None = None
    ended: datetime | None = None
    output_log: bytearray = field(default_factory=bytearray)
    result_text: str = ""  # what came out of the command, in one sentence
    error_text: str = ""
    path_by_kind: dict[str, str] = field(default_factory=dict)  # kind of file -> path
    event_reader: EventReader = field(default_factory=EventReader)
    guard_pipe: int | None = None  # the writing end of the pipe to the job's guard

    def as_json(self) -> dict[str, Any]:
        order = self.job_command.job_request
        facts: dict[str, Any] = {"id": self.id, "kind": order.kind, "title": self.job_command.title}
        facts |= {name: getattr(order, name, None) for name in ("run", "experiment")}
        if folder := self.job_command.run_folder:
            facts["run"] = facts["run"] or folder.name
        facts |= {"state": self.state.value, "progress": self.progress, "message": self.message}
        facts |= {
            "result": self.result_address,
            "started": _utc_text(self.started),
            "ended": _utc_text(self.ended),
        }
        return facts

    @property
    def log_text(self) -> str:
        """The output, without control characters and absolute paths."""
        return _printable_bytes(self.output_log)

    def add_output(self, data: bytes) -> None:
        self.output_log += data
        del self.output_log[:-_MOST_LOG_BYTES]

    def add_events(self, data: bytes) -> None:
        """Take in what the command sent through the pipe for events."""
        for event in self.event_reader.read(data):
            self._apply_event(event)

    def _apply_event(self, event: JobEvent) -> None:
        if isinstance(event, FileEvent):
            self.path_by_kind[event.kind] = event.path
        elif isinstance(event, PhaseEvent):
            count = f" {event.done}/{event.total}" if event.total else ""
            parts = (_short_text(f"{event.phase}{count}"), describe_outcomes(Counter(event.outcomes)))
            self.message = ", ".join(filter(None, parts))
            self.progress = min(1.0, event.done / event.total) if event.total else None
        elif event.event == "result":
            self.result_text = _short_text(event.text)
        elif event.event == "error":
            self.error_text = _short_text(event.text)
        else:
            self.message = f"warning: {_short_text(event.text)}"


class ServeJobs:
    """The jobs of a server. `report_at` returns the address of the report of a run folder."""

    def __init__(self, most_jobs_at_once: int, report_at: Callable[[Path], str | None]) -> None:
        self._jobs: dict[str, ServeJob] = {}
        self._count = 0
        self._waiting: queue.Queue[ServeJob | None] = queue.Queue()
        self._lock = threading.Lock()
        self._report_at = report_at
        self._closed = False
        self._threads = [
            threading.Thread(target=self._run_jobs, daemon=True) for _ in range(most_jobs_at_once)
        ]
        for thread in self._threads:
            thread.start()

    def submit(self, command: JobCommand) -> ServeJob:
        """Queue a job; MutatorError if too many are waiting."""
        with self._lock:
            if sum(job.state is JobState.QUEUED for job in self._jobs.values()) >= _MOST_WAITING_JOBS:
                raise MutatorError(
                    f"{_MOST_WAITING_JOBS} jobs are waiting", remedy="wait for them, or cancel some"
                )
            self._count += 1
            job = ServeJob(id=str(self._count), job_command=command)
            self._jobs[job.id] = job
            for name in [name for name, job_in_list in self._jobs.items() if job_in_list.ended][
                :-_MOST_ENDED_JOBS
            ]:
                del self._jobs[name]
        self._waiting.put(job)
        return job

    def all(self) -> list[ServeJob]:
        with self._lock:
            return [*reversed(self._jobs.values())]

    def get(self, name: str) -> ServeJob:
        with self._lock:
            if name in self._jobs:
                return self._jobs[name]
        raise NotServed(f"no job '{name}'", expected="the id of a job of this server")

    def cancel(self, name: str) -> None:
        """Cancel a job with all its processes; JobAlreadyEnded if the job has already ended."""
        job = self.get(name)
        with self._lock:
            if job.ended:
                raise JobAlreadyEnded(f"job {name} has ended ({job.state})")
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
            thread.join(_MOST_SHUTDOWN_S)

    def _cancel(self, job: ServeJob) -> None:
        if job.state is JobState.QUEUED:
            job.ended = datetime.now(UTC)
        job.state, job.message = JobState.CANCELLED, "cancelled"
        if job.guard_pipe is not None:
            os.close(job.guard_pipe)
            job.guard_pipe = None

    def _run_jobs(self) -> None:
        while (job := self._waiting.get()) is not None:
            try:
                events_in, events_out = os.pipe()
            except OSError as err:
                with self._lock:
                    self._mark_failed(job, err)
                continue
            with os.fdopen(events_in, "rb", buffering=0) as pipe:
                try:
                    process = self._start_process(job, events_out)
                finally:
                    os.close(events_out)
                if process is not None:
                    self._follow_process(job, process, pipe)

    def _start_process(self, job: ServeJob, events: int) -> subprocess.Popen[bytes] | None:
        """Start the job's command, which sends its events to the pipe `events`; None if it must not start."""
        with self._lock:
            if job.state is not JobState.QUEUED or self._closed:
                return None
            try:
                guard_end, job.guard_pipe = os.pipe()
            except OSError as err:
                self._mark_failed(job, err)
                return None
            try:
                process = subprocess.Popen(
                    [sys.executable, "-P", "-m", _GUARD_MODULE, str(guard_end), *job.job_command.argv],
                    pass_fds=[guard_end, events],
                    env={**os.environ, "COLUMNS": _OUTPUT_COLUMNS, EVENTS_FD_VARIABLE: str(events)},
                    stdin=subprocess.DEVNULL,
                    stdout=subprocess.PIPE,
                    stderr=subprocess.STDOUT,
                    start_new_session=True,  # only the server handles Ctrl-C
                )
            except OSError as err:
                os.close(job.guard_pipe)
                self._mark_failed(job, err)
                return None
            finally:
                os.close(guard_end)
            job.state, job.started = JobState.RUNNING, datetime.now(UTC)
            return process

    def _mark_failed(self, job: ServeJob, err: OSError) -> None:
        job.guard_pipe, job.state, job.message = None, JobState.FAILED, f"cannot be started: {err.strerror}"
        job.ended = datetime.now(UTC)

    def _follow_process(self, job: ServeJob, process: subprocess.Popen[bytes], events: IO[bytes]) -> None:
        assert process.stdout is not None
        with process.stdout as output:
            self._read_pipes(job, {output.fileno(): job.add_output, events.fileno(): job.add_events})
        code = process.wait()
        result = self._result_address(job) if code == 0 else None
        with self._lock:
            if job.state is JobState.RUNNING:
                job.state = JobState.DONE if code == 0 else JobState.FAILED
                job.progress, job.result_address = 1.0 if code == 0 else job.progress, result
                job.message = _success_message(job) if code == 0 else _failure_message(job)
            job.ended = datetime.now(UTC)
            if job.guard_pipe is not None:
                os.close(job.guard_pipe)
                job.guard_pipe = None

    def _read_pipes(self, job: ServeJob, readers: dict[int, Callable[[bytes], None]]) -> None:
        """Give what the job's command writes to its readers, until it has closed all pipes."""
        with selectors.DefaultSelector() as pipes:
            for pipe, reader in readers.items():
                pipes.register(pipe, selectors.EVENT_READ, reader)
            while pipes.get_map():
                for ready, _ in pipes.select():
                    data = os.read(ready.fd, _READ_CHUNK_BYTES)
                    if not data:
                        pipes.unregister(ready.fd)
                    with self._lock:
                        if job.state is JobState.RUNNING:
                            ready.data(data)

    def _result_address(self, job: ServeJob) -> str | None:
        if job.job_command.job_request.kind == "try":
            folder = job.path_by_kind.get("trial")
            return trial_address(Path(folder).name) if folder else None
        if smallest := job.path_by_kind.get(SMALLEST_FORM_LINK):
            report = self._report_at(Path(smallest).parent)
            return f"{report}#e={Path(smallest).name}" if report else None
        command = job.job_command
        return command.result_address or (self._report_at(command.run_folder) if command.run_folder else None)


def _printable_bytes(data: bytes | bytearray) -> str:
    return _printable_text(data.decode("utf-8", "replace"))


def _printable_text(text: str) -> str:
    text = without_absolute_folders(_ESCAPE_CODE_PATTERN.sub("", text))
    return "".join(c for c in text if c.isprintable() or c in "\n\t")


def _short_text(text: str) -> str:
    return _printable_text(text)[:_MOST_MESSAGE_CHARACTERS]


def _success_message(job: ServeJob) -> str:
    film = job.path_by_kind.get("film")
    return f"film: {_short_text(film)}" if film else job.result_text or job.message


def _failure_message(job: ServeJob) -> str:
    return job.error_text or job.result_text or job.message or "no output"


def _utc_text(moment: datetime | None) -> str | None:
    return moment.strftime("%Y-%m-%dT%H:%M:%SZ") if moment else None
