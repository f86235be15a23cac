"""The plugin of xdist workers, which imports no reader of YAML.

The controller lists the items before a worker begins, and sends what it needs to run them once the checks
have passed.
"""

import pickle
from pathlib import Path
from queue import SimpleQueue
from typing import Any

import pytest

from mutator.errors import MutatorError, PytestItemFailed
from mutator.execution.campaign_items import (
    PROBLEM_KEY,
    CampaignFile,
    ItemSource,
    collect_alone,
    node_id_of_file,
    source_of,
    sources_of_sets,
)
from mutator.execution.golden_facts import GoldenFacts
from mutator.execution.item_running import FinishedItems, ItemRunner, ItemsStart
from mutator.execution.listed_items import ItemListing
from mutator.execution.requested_campaigns import WORKER_INPUT_KEY
from mutator.execution.worker import WorkerOfProcess
from mutator.execution.worker_processes import bind_to_parent
from mutator.store.run_folder import RunFolder

WRITTEN_KEY = "mutator_written"
START_COMMAND = "mutator_start"
GOLDENS_COMMAND = "mutator_goldens"


class WorkerSource(ItemSource):
    """A campaign in an xdist worker."""

    def __init__(self, listing: ItemListing) -> None:
        super().__init__()
        self._listing = listing
        self.start = ItemsStart(problem="the controller has not sent what is needed to begin")
        self._process: WorkerOfProcess | None = None
        self.new_goldens: SimpleQueue[GoldenFacts] = SimpleQueue()  # filled by another thread

    @property
    def listing(self) -> ItemListing:
        return self._listing

    def ensure_runner(self) -> ItemRunner | FinishedItems:
        runner = super().ensure_runner()
        while not self.new_goldens.empty():
            assert self._process is not None
            self._process.ensure_worker().add_goldens(self.new_goldens.get())
        return runner

    def _begin(self) -> ItemRunner | FinishedItems:
        if self.start.endings:
            return FinishedItems(self.start.endings)
        if self.start.worker is None:
            raise PytestItemFailed(self.start.problem)
        self._process = WorkerOfProcess(self.start.worker)
        folder = RunFolder.open(self.start.worker.assignment.run_folder)
        return ItemRunner(folder, self.start, self._process.ensure_worker)

    def close(self, *, is_stopped: bool) -> dict[str, str]:
        """Do what remains of the proof, and close the worker's files; return their digests."""
        if self._process is None:
            return {}
        if isinstance(self._runner, ItemRunner) and not is_stopped:
            self._runner.prove_rest()
        return self._process.close()


class WorkerPlugin:
    """Collects the items that the controller has listed, and runs those that it receives."""

    def __init__(self, config: pytest.Config, worker_input: dict[str, Any]) -> None:
        campaigns = worker_input[WORKER_INPUT_KEY]
        bind_to_parent(campaigns["parent"])
        self._config = config
        self._sources = {
            path: WorkerSource(pickle.loads(listing)) for path, listing in campaigns["listings"].items()
        }
        self._is_alone = campaigns["alone"]
        config.args[:] = campaigns["places"]

    @pytest.hookimpl(trylast=True)
    def pytest_sessionstart(self) -> None:
        _receive_starts(self._config, self._sources)

    def pytest_collection(self, session: pytest.Session) -> bool | None:
        if not self._is_alone:
            return None
        path, *_ = self._sources
        node_id = node_id_of_file(session, Path(path))
        sources = [*self._sources.values()]
        file = CampaignFile.from_parent(session, path=Path(path), sources=sources, nodeid=node_id)
        return collect_alone(session, file)

    def pytest_collect_file(self, file_path: Path, parent: pytest.Collector) -> CampaignFile | None:
        source = source_of(file_path, self._sources)
        if source is None:
            return None
        sources = [source, *sources_of_sets(file_path, self._sources)]
        return CampaignFile.from_parent(parent, path=file_path, sources=sources)

    def pytest_sessionfinish(self, session: pytest.Session, exitstatus: int) -> None:
        output = self._config.workeroutput  # type: ignore[attr-defined]
        is_interrupted = exitstatus == pytest.ExitCode.INTERRUPTED
        is_stopped = is_interrupted or bool(session.shouldstop or session.shouldfail)
        written = output[WRITTEN_KEY] = {}
        for path, source in self._sources.items():
            try:
                written[path] = source.close(is_stopped=is_stopped)
            except MutatorError as err:
                output[PROBLEM_KEY] = str(err)


def _receive_starts(config: pytest.Config, sources: dict[str, WorkerSource]) -> None:
    """Let the worker understand further commands, which come before the items that need them."""
    manager = config.pluginmanager
    interactor: Any = next(p for p in manager.get_plugins() if type(p).__name__ == "WorkerInteractor")
    handle_command = interactor.handle_command

    def handle(command: Any) -> None:
        if isinstance(command, tuple) and command[0] == START_COMMAND:
            for path, start in command[1]["starts"].items():
                sources[path].start = ItemsStart.from_bytes(start)
        elif isinstance(command, tuple) and command[0] == GOLDENS_COMMAND:
            for source in sources.values():
                source.new_goldens.put(GoldenFacts.from_bytes(command[1]["facts"]))
        else:
            handle_command(command)

    interactor.handle_command = handle
