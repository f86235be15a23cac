"""A campaign's work as pytest items, and the plugin of xdist workers, which imports no reader of YAML."""

import os
import traceback
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from mutator._common.files import raising_disk_full
from mutator._common.folder_locks import open_worker_lock
from mutator._common.resource_shortages import find_shortage
from mutator.campaigns.chunks import PendingChunk
from mutator.campaigns.run_inputs import RunInputs
from mutator.errors import DiskFull, MutatorError, PytestItemFailed, ResourceShortage
from mutator.execution.run_reuse import ReuseAssignment
from mutator.execution.suspended_workers import on_resume
from mutator.execution.worker import Worker, WorkerAssignment, bind_to_parent
from mutator.execution.written_files import FileDigests
from mutator.preflight.equivalence_check import SampledExperiment

INPUT_KEY = "mutator_campaign"
PROBLEM_KEY = "mutator_problem"
WRITTEN_KEY = "mutator_written"


class CampaignItem(pytest.Item):
    """An item that does part of a campaign's work. It fails only for harness errors."""

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: Any = None) -> Any:
        if isinstance(excinfo.value, PytestItemFailed | MutatorError):
            return str(excinfo.value)
        return super().repr_failure(excinfo, style)

    def reportinfo(self) -> tuple[Path, None, str]:
        return self.config.rootpath, None, self.name


class WorkItem(CampaignItem):
    """One chunk of the plan, or one experiment of the proof. A hazard is a result, not a failure."""

    def __init__(
        self, *, work: PendingChunk | SampledExperiment, worker: "LazyWorker", **keywords: Any
    ) -> None:
        super().__init__(**keywords)
        self.work = work
        self.worker = worker

    def runtest(self) -> None:
        try:
            with raising_disk_full(self.config.rootpath):
                worker, work = self.worker.ensure_worker(), self.work
                errors = worker.run(work) if isinstance(work, PendingChunk) else worker.prove(work)
        except Exception as err:
            reported_error = err if isinstance(err, MutatorError) else find_shortage(err)
            problem = str(reported_error) if reported_error else _describe_defect(err, self.name)
            self.user_properties.append((PROBLEM_KEY, problem))
            if isinstance(reported_error, DiskFull | ResourceShortage):
                self.session.shouldstop = problem
            raise
        if errors:
            raise PytestItemFailed("\n".join(f"{name}: {detail}" for name, detail in errors))


def _describe_defect(err: Exception, item_name: str) -> str:
    lines = "".join(traceback.format_exception(err))
    request = f"{item_name} failed because of a defect in mutator; please report it with these lines:"
    return f"{request}\n{lines}".rstrip()


class LazyWorker:
    """The worker of this process, made when the first chunk runs, because collection does not need it."""

    def __init__(self, load_inputs: Callable[[], RunInputs], assignment: WorkerAssignment) -> None:
        self._load_inputs = load_inputs
        self._assignment = assignment
        self._worker: Worker | None = None

    def ensure_worker(self) -> Worker:
        if self._worker is None:
            self._worker = Worker(self._load_inputs(), self._assignment)
        return self._worker

    def note_suspension(self) -> None:
        """Note that this process was stopped and continued."""
        if self._worker is not None:
            self._worker.was_suspended = True

    def close(self) -> FileDigests:
        """Close the worker's files; return their digests."""
        worker, self._worker = self._worker, None
        if worker is None:
            return {}
        worker.close()
        return worker.file_digests


def collect_items(
    session: pytest.Session, work_parts: Sequence[PendingChunk | SampledExperiment], worker: LazyWorker
) -> bool:
    """Make the session's items: chunks, then experiments of the proof.

    The proof has the smallest items and comes last, so that the workers finish at about the same time.
    """
    session.items = []
    for work in work_parts:
        name = (
            f"chunk-{work.chunk_index:05d}" if isinstance(work, PendingChunk) else f"proof-{work.number:05d}"
        )
        session.items.append(
            WorkItem.from_parent(session, name=name, nodeid=f"campaign::{name}", work=work, worker=worker)
        )
    session.testscollected = len(session.items)
    session.config.hook.pytest_collection_finish(session=session)
    return True


class WorkerPlugin:
    """Plugin of an xdist worker: collects the pending work, and runs the items that it receives."""

    def __init__(self, config: pytest.Config, worker_input: dict[str, Any]) -> None:
        campaign_input = worker_input[INPUT_KEY]
        bind_to_parent(campaign_input["parent"])
        run = Path(campaign_input["run"])
        assignment = WorkerAssignment(
            run_folder=run,
            worker_name=campaign_input["session"] + worker_input["workerid"],
            engine=campaign_input["engine"],
            golden_digests=campaign_input["goldens"],
            secret=campaign_input["secret"],
            parent_pid=campaign_input["parent"],
            reuse=ReuseAssignment(**campaign_input["reuse"]) if campaign_input["reuse"] else None,
        )
        self._config = config
        self._registration = open_worker_lock(run)
        self._pending_work: list[PendingChunk | SampledExperiment] = [
            *(PendingChunk(chunk, tuple(places)) for chunk, places in campaign_input["pending"]),
            *(SampledExperiment(number, name) for number, name in campaign_input["proof"]),
        ]
        self._lazy_worker = LazyWorker(partial(RunInputs.from_bytes, campaign_input["inputs"]), assignment)
        on_resume(self._lazy_worker.note_suspension)

    def pytest_collection(self, session: pytest.Session) -> bool:
        return collect_items(session, self._pending_work, self._lazy_worker)

    def pytest_sessionfinish(self) -> None:
        try:
            written = self._lazy_worker.close()
            self._config.workeroutput[WRITTEN_KEY] = dict(written)  # type: ignore[attr-defined]
        except MutatorError as err:
            self._config.workeroutput[PROBLEM_KEY] = str(err)  # type: ignore[attr-defined]
        os.close(self._registration)
