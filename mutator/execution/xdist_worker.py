"""A campaign's work as pytest items, and the plugin of xdist workers, which imports no reader of YAML."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest

from mutator._common.files import raising_disk_full
from mutator.campaigns.chunks import PendingChunk
from mutator.errors import DiskFull, MutatorError, PytestItemFailed, ResourceShortage
from mutator.execution.worker import Worker, WorkerOfProcess, WorkerStart
from mutator.execution.worker_problems import describe_problem, reported_error
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
        self,
        *,
        work: PendingChunk | SampledExperiment,
        ensure_worker: Callable[[], Worker],
        **keywords: Any,
    ) -> None:
        super().__init__(**keywords)
        self.work = work
        self.ensure_worker = ensure_worker

    def runtest(self) -> None:
        try:
            with raising_disk_full(self.config.rootpath):
                worker, work = self.ensure_worker(), self.work
                errors = worker.run(work) if isinstance(work, PendingChunk) else worker.prove(work)
        except Exception as err:
            error = reported_error(err)
            problem = str(error) if error else _describe_defect(err, self.name)
            self.user_properties.append((PROBLEM_KEY, problem))
            if isinstance(error, DiskFull | ResourceShortage):
                self.session.shouldstop = problem
            raise
        if errors:
            raise PytestItemFailed("\n".join(f"{name}: {detail}" for name, detail in errors))


def _describe_defect(err: Exception, item_name: str) -> str:
    request = f"{item_name} failed because of a defect in mutator; please report it with these lines:"
    return f"{request}\n{describe_problem(err)}"


def item_name_of(work: PendingChunk | SampledExperiment) -> str:
    if isinstance(work, PendingChunk):
        return f"chunk-{work.chunk_index:05d}"
    return f"proof-{work.number:05d}"


def node_id_of(work: PendingChunk | SampledExperiment) -> str:
    return f"campaign::{item_name_of(work)}"


def collect_items(
    session: pytest.Session,
    work_parts: Sequence[PendingChunk | SampledExperiment],
    ensure_worker: Callable[[], Worker],
) -> bool:
    """Make the session's items: chunks, then experiments of the proof.

    The proof has the smallest items and comes last, so that the workers finish at about the same time.
    """
    session.items = []
    for work in work_parts:
        name = item_name_of(work)
        session.items.append(
            WorkItem.from_parent(
                session, name=name, nodeid=node_id_of(work), work=work, ensure_worker=ensure_worker
            )
        )
    session.testscollected = len(session.items)
    session.config.hook.pytest_collection_finish(session=session)
    return True


class WorkerPlugin:
    """Plugin of an xdist worker: collects the pending work, and runs the items that it receives."""

    def __init__(self, config: pytest.Config, worker_input: dict[str, Any]) -> None:
        campaign_input = worker_input[INPUT_KEY]
        self._config = config
        self._pending_work: list[PendingChunk | SampledExperiment] = [
            *(PendingChunk(chunk, tuple(places)) for chunk, places in campaign_input["pending"]),
            *(SampledExperiment(number, name) for number, name in campaign_input["proof"]),
        ]
        self._process = WorkerOfProcess(WorkerStart.from_bytes(campaign_input["start"]))

    def pytest_collection(self, session: pytest.Session) -> bool:
        return collect_items(session, self._pending_work, self._process.ensure_worker)

    def pytest_sessionfinish(self) -> None:
        output = self._config.workeroutput  # type: ignore[attr-defined]
        try:
            output[WRITTEN_KEY] = self._process.close()
        except MutatorError as err:
            output[PROBLEM_KEY] = str(err)
