"""Campaigns in a pytest session: the plugin of the process that is no xdist worker.

It runs the items itself or, with pytest-xdist, deals them to workers (`xdist_worker`). In a user's session,
it also opens the run folders, and prints the summaries.
"""

import os
import pickle
import shlex
import signal
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

import pytest

from mutator._common.folder_locks import living_worker_pids
from mutator._common.resource_shortages import find_shortage
from mutator.errors import EXIT_HARNESS_ERRORS, MutatorError, PytestItemFailed
from mutator.execution.campaign_items import (
    PROBLEM_KEY,
    CampaignFile,
    CampaignItem,
    ItemSource,
    collect_alone,
    file_of,
    node_id_of_file,
    source_of,
    sources_of_sets,
)
from mutator.execution.campaign_runs import FileRun
from mutator.execution.item_running import ItemRunner, ItemsStart
from mutator.execution.listed_items import ItemListing
from mutator.execution.piece_scheduling import PieceScheduling, is_scheduler_chosen
from mutator.execution.progress_reporting import reporting_progress
from mutator.execution.requested_campaigns import WORKER_INPUT_KEY
from mutator.execution.session import Session
from mutator.execution.session_items import SessionItems
from mutator.execution.session_summary import Summary
from mutator.execution.suspended_workers import WorkerContinuer
from mutator.execution.worker_processes import python_command_dying_with
from mutator.execution.xdist_checks import XdistChecks
from mutator.execution.xdist_worker import START_COMMAND, WRITTEN_KEY


class WorkDistributor(Protocol):
    def run(self, session: Session) -> None: ...


class PreparedRun(ItemSource):
    """The campaign of a session that another command has prepared, and will finish."""

    def __init__(self, session: Session) -> None:
        super().__init__()
        self.session: Session | None = session
        self._items = SessionItems(session=session)
        self._listing = self._items.list_work()

    @property
    def listing(self) -> ItemListing:
        return self._listing

    def start_for_worker(self, name: str) -> ItemsStart:
        return self._items.start_for(self._items.session.start_of_worker(name))

    def _begin(self) -> ItemRunner:
        return self._items.start_here()

    def close(self, *, is_stopped: bool) -> None:
        self._items.close(self._runner, is_stopped=is_stopped)


class CampaignController:
    """Deals the items of campaigns, by real path of their files. If `is_alone`, there is one campaign, and
    nothing else.
    """

    def __init__(self, sources: Mapping[str, PreparedRun | FileRun], *, is_alone: bool = False) -> None:
        self._sources, self._is_alone = sources, is_alone
        self._worker_continuer: WorkerContinuer | None = None
        self._node_ids: list[str] = []  # what xdist's workers have selected
        self._begun_nodes: set[Any] = set()
        self._golden_key_by_name: dict[str, str] = {}
        self._is_interrupted = False
        self._checks = next(
            (XdistChecks(s.session) for s in sources.values() if isinstance(s, PreparedRun) and s.session),
            None,
        )

    @pytest.hookimpl(optionalhook=True)
    def pytest_xdist_setupnodes(self, config: pytest.Config, specs: Sequence[Any]) -> None:
        self._worker_continuer = WorkerContinuer()
        for spec in specs:
            if spec.popen and not spec.python:
                spec.python = shlex.join(python_command_dying_with(os.getpid()))

        if self._checks is not None:
            self._checks.begin(config, len(specs))

    @pytest.hookimpl(optionalhook=True)
    def pytest_configure_node(self, node: Any) -> None:
        if not self._golden_key_by_name:
            items = [item for source in self._sources.values() for item in source.listing.items]
            self._golden_key_by_name = {item.name: item.golden_key for item in items}
        listings = {path: pickle.dumps(source.listing) for path, source in self._sources.items()}
        node.workerinput[WORKER_INPUT_KEY] = {
            "parent": os.getpid(),
            "places": list(node.config.args),  # where to collect: not only what the command names
            "listings": listings,
            "alone": self._is_alone,
        }

    @pytest.hookimpl(optionalhook=True, wrapper=True)
    def pytest_xdist_make_scheduler(self, config: pytest.Config, log: Any) -> Any:
        scheduler = yield
        if not is_scheduler_chosen(config) and self._has_only_campaigns(config):
            scheduler = PieceScheduling(
                config,
                log,
                self._golden_key_of,
                self._checks.remaining if self._checks else lambda: None,
                self._checks.is_checked if self._checks else lambda golden_key: True,
            )
        if self._checks is not None:
            self._checks.scheduler = scheduler
        _call_before(scheduler, "add_node_collection", self._note_collection)
        _call_before(scheduler, "schedule", lambda: self._begin_workers(config, scheduler.nodes))
        return scheduler

    @pytest.hookimpl(optionalhook=True)
    def pytest_testnodedown(self, node: Any, error: object | None) -> None:
        output = getattr(node, "workeroutput", {})
        for path, source in self._sources.items():
            if source.session is None:
                continue
            if error:
                _note_problem(source.session, f"worker {node.gateway.id} died: {error}")
            _note_problem(source.session, output.get(PROBLEM_KEY, ""))
            if (written := output.get(WRITTEN_KEY, {}).get(path)) is not None:
                name = f"{source.session.worker_prefix}{node.gateway.id}"
                source.session.written.add_report(written, name)

    def pytest_collection(self, session: pytest.Session) -> bool | None:
        if session.config.pluginmanager.hasplugin("dsession") or not self._is_alone:
            return None  # xdist's hook collects nothing in this process
        path, *_ = self._sources
        file = self._make_file(Path(path), session, nodeid=node_id_of_file(session, Path(path)))
        return collect_alone(session, file)

    def pytest_collect_file(self, file_path: Path, parent: pytest.Collector) -> pytest.File | None:
        is_campaign = source_of(file_path, self._sources) is not None
        return self._make_file(file_path, parent) if is_campaign else None

    def _make_file(self, path: Path, parent: pytest.Collector, **more: Any) -> pytest.File:
        source = source_of(path, self._sources)
        assert source is not None
        sources = [source, *sources_of_sets(path, self._sources)]
        return CampaignFile.from_parent(parent, path=path, sources=sources, **more)

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if problem := dict(report.user_properties).get(PROBLEM_KEY):
            for session in self._sessions():
                _note_problem(session, str(problem))

    def pytest_keyboard_interrupt(self, excinfo: pytest.ExceptionInfo[BaseException]) -> None:
        if type(excinfo.value) is KeyboardInterrupt:  # pytest's own exceptions mean a regular stop
            self._is_interrupted = True
        for session in self._sessions():
            session.interrupted |= self._is_interrupted
            # workers ignore Ctrl-C, and xdist would wait for their items
            for pid in living_worker_pids(session.folder.path):
                os.kill(pid, signal.SIGTERM)

    def pytest_internalerror(self, excinfo: pytest.ExceptionInfo[BaseException]) -> None:
        for session in self._sessions():
            _note_problem(session, str(find_shortage(excinfo.value) or ""))

    @pytest.hookimpl(trylast=True)  # after xdist has ended its workers
    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        for source in self._sources.values():
            if isinstance(source, PreparedRun):
                source.close(is_stopped=self._is_interrupted or _is_stopped(session))
        if self._worker_continuer is not None:
            self._worker_continuer.end()

    def _sessions(self) -> Iterable[Session]:
        return [source.session for source in self._sources.values() if source.session is not None]

    def _has_only_campaigns(self, config: pytest.Config) -> bool:
        """Whether a scheduler that a user's configuration names for other tests can be replaced."""
        names = {os.path.realpath(argument.partition("::")[0]) for argument in config.args}
        return self._is_alone or names <= self._sources.keys() or config.option.dist == "load"

    def _golden_key_of(self, node_id: str) -> str | None:
        """Return the golden run of an item; None for a test."""
        return self._golden_key_by_name.get(node_id.rpartition("::")[2])

    def _note_collection(self, node: Any, collection: Sequence[str]) -> None:
        self._node_ids = list(collection)

    def _selected_sources(self, root: Path) -> set[str]:
        """Return the keys of the sources of which an item is selected."""
        files = {os.path.realpath(root / name) for name in {i.partition("::")[0] for i in self._node_ids}}
        # outside of the folder of pytest's settings, a node id has no path
        has_paths = not files.isdisjoint(self._sources)
        names = {node_id.rpartition("::")[2] for node_id in self._node_ids}
        selected = set()
        for key, source in self._sources.items():
            if has_paths and file_of(key) not in files:
                continue
            # without an item, a set of defences is not even checked
            if (has_paths and key == file_of(key)) or not names.isdisjoint(_item_names(source)):
                selected.add(key)
        return selected

    def _begin_workers(self, config: pytest.Config, nodes: Iterable[Any]) -> None:
        """Send workers what they need, before their first item."""
        selected = self._selected_sources(config.rootpath)
        for node in nodes:
            if node in self._begun_nodes:
                continue
            self._begun_nodes.add(node)
            starts = {
                path: source.start_for_worker(node.gateway.id).to_bytes()
                for path, source in self._sources.items()
                if path in selected
            }
            node.sendcommand(START_COMMAND, starts=starts)
            if self._checks is not None:
                self._checks.note_worker_began(node)


def _item_names(source: ItemSource) -> Iterable[str]:
    return (item.name for item in source.listing.items)


class StandaloneController(CampaignController):
    """The controller of a user's session: it ends what has begun, and prints the summaries."""

    def __init__(self, runs: Mapping[str, FileRun], *, is_alone: bool) -> None:
        super().__init__(runs, is_alone=is_alone)
        self._runs = runs
        self._closing_lines: list[str] = []

    @pytest.hookimpl(trylast=True)
    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        super().pytest_sessionfinish(session)
        is_stopped = self._is_interrupted or _is_stopped(session)
        for run in self._runs.values():
            try:
                summary = run.finish(is_stopped=is_stopped)
                if run.failure is not None:
                    session.exitstatus = run.failure.exit_code
                if summary is not None:
                    title = f"{run.title}: " if len(self._runs) > 1 else ""
                    self._closing_lines += _summary_lines(run, summary, title)
                    session.exitstatus = _exit_status(session, run, summary)
            except MutatorError as err:
                self._closing_lines.append(str(err))
                session.exitstatus = err.exit_code

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        if self._closing_lines:
            terminalreporter.section("campaigns" if len(self._runs) > 1 else "campaign")
        for line in self._closing_lines:
            terminalreporter.write_line(line)


class ClusterItem(CampaignItem):
    """All of a campaign's work, done by a cluster."""

    def __init__(self, *, run: FileRun, distributor: WorkDistributor, **keywords: Any) -> None:
        super().__init__(**keywords)
        self._run, self._distributor = run, distributor

    def runtest(self) -> None:
        self._run.begin()
        session = self._run.session
        assert session is not None
        if not (session.pending or session.proof):
            return
        with reporting_progress(session):
            self._distributor.run(session)
        if session.interrupted:
            raise KeyboardInterrupt
        if session.problem:
            raise PytestItemFailed(session.problem)


class ClusterFile(pytest.File):
    """The file of a campaign that a cluster runs."""

    def __init__(self, *, runs: Sequence[FileRun], distributor: WorkDistributor, **keywords: Any) -> None:
        super().__init__(**keywords)
        self._runs, self._distributor = runs, distributor

    def collect(self) -> Iterable[ClusterItem]:
        for run in self._runs:
            name = "cluster" if run is self._runs[0] else f"cluster, {run.title}"
            yield ClusterItem.from_parent(self, name=name, run=run, distributor=self._distributor)


class ClusterController(StandaloneController):
    """The controller of a session whose campaigns run on a cluster."""

    def __init__(self, runs: Mapping[str, FileRun], distributor: WorkDistributor, *, is_alone: bool) -> None:
        super().__init__(runs, is_alone=is_alone)
        self._distributor = distributor

    def _make_file(self, path: Path, parent: pytest.Collector, **more: Any) -> pytest.File:
        run = self._runs[os.path.realpath(path)]
        if run.deals_work:
            return super()._make_file(path, parent, **more)
        runs = [run, *sources_of_sets(path, self._runs)]
        return ClusterFile.from_parent(parent, path=path, runs=runs, distributor=self._distributor, **more)


def _is_stopped(session: pytest.Session) -> bool:
    return bool(session.shouldstop or session.shouldfail)


def _note_problem(session: Session, problem: str) -> None:
    if problem and not session.problem and not session.interrupted:
        session.problem = problem


def _call_before(scheduler: Any, name: str, before: Callable[..., None]) -> None:
    """Let a method of one object call something first. Schedulers of other packages have no hook for it."""
    method = getattr(scheduler, name)

    def call(*arguments: Any, **keywords: Any) -> Any:
        before(*arguments, **keywords)
        return method(*arguments, **keywords)

    setattr(scheduler, name, call)


def _exit_status(session: pytest.Session, run: FileRun, summary: Summary) -> int:
    """Return the exit status of a session: pytest's, unless the campaign has a worse one."""
    status = int(session.exitstatus)
    if summary.interrupted:
        return status
    if summary.harness_errors or summary.problem:
        return EXIT_HARNESS_ERRORS
    is_whole = summary.done == summary.planned
    return summary.exit_code if is_whole and not status and run.must_reach_hazard else status


def _summary_lines(run: FileRun, summary: Summary, title: str) -> list[str]:
    missing = summary.planned - summary.done
    lines = [
        *run.result_lines(summary),
        f"{title}{summary.done} of {summary.planned} experiments done, {summary.ran} now",
        summary.reuse_note,
        ", ".join(f"{name} {count}" for name, count in sorted(summary.outcomes.items())),
        "" if summary.results else summary.golden_hazards_note,
        summary.problem,
        *(f"{name}: {what}" for name, what in summary.harness_errors),
        f"proof: {summary.proof_note}" if summary.proof_note and not missing else "",
        f"results: {summary.results}" if summary.results else f"run folder: {run.out}",
        *(f"{name}: {value}" for name, value in summary.seals.digest_by_name().items()),
    ]
    if missing and not summary.problem:
        lines.append(f"results.csv and the seal come when the other {missing} have a result")
    return [line for line in lines if line]
