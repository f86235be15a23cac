"""Campaigns as pytest sessions: the controller, whose xdist workers have `xdist_worker`."""

import os
import shlex
import signal
import sys
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Protocol

import pytest

from mutator._common.folder_locks import living_worker_pids
from mutator._common.resource_shortages import find_shortage
from mutator.campaigns.chunks import golden_key_by_chunk
from mutator.errors import MutatorError, PytestItemFailed
from mutator.execution.piece_scheduling import PieceScheduling, is_scheduler_chosen
from mutator.execution.progress_reporting import reporting_progress
from mutator.execution.progress_text import ProgressLines
from mutator.execution.session import Session
from mutator.execution.session_opening import open_session
from mutator.execution.session_summary import Summary
from mutator.execution.suspended_workers import WorkerContinuer
from mutator.execution.worker import Worker
from mutator.execution.worker_processes import python_command_dying_with
from mutator.execution.xdist_worker import (
    INPUT_KEY,
    PROBLEM_KEY,
    WRITTEN_KEY,
    CampaignItem,
    collect_items,
    node_id_of,
)
from mutator.store.plan_choices import Choices
from mutator.store.run_progress import ProgressCallback
from mutator.workspace import Workspace


class WorkDistributor(Protocol):
    def run(self, session: Session) -> None: ...


class DistributedItem(CampaignItem):
    """All of a session's work, done by a cluster."""

    def __init__(self, *, campaign_session: Session, distributor: WorkDistributor, **keywords: Any) -> None:
        super().__init__(**keywords)
        self._campaign_session, self._distributor = campaign_session, distributor

    def runtest(self) -> None:
        with reporting_progress(self._campaign_session):
            self._distributor.run(self._campaign_session)
        if self._campaign_session.interrupted:
            raise KeyboardInterrupt
        if self._campaign_session.problem:
            raise PytestItemFailed(self._campaign_session.problem)


def register_controller(
    config: pytest.Config,
    campaign: str,
    out: Path,
    *,
    reviewed: bool,
    accept_versions: bool,
    sandbox: bool,
    reuse: bool,
    distributor: "WorkDistributor | None" = None,
    packages: Sequence[str] = (),
) -> None:
    """Register the plugin of the process that is no worker.

    The items of a campaign are dealt to all workers, even if the user's configuration groups tests by file.
    With a `distributor`, pytest itself distributes nothing; `packages` are what it comes from.
    """
    if getattr(config.option, "dist", "no") != "no" and not is_scheduler_chosen(config):
        config.option.dist = "load"
    if not any(isinstance(plugin, CampaignController) for plugin in config.pluginmanager.get_plugins()):
        config.pluginmanager.register(
            StandaloneController(
                campaign,
                out,
                reviewed=reviewed,
                accept_versions=accept_versions,
                sandbox=sandbox,
                reuse=reuse,
                distributor=distributor,
                packages=packages,
            )
        )


class CampaignController:
    """Plugin of the controller: distributes chunks or, without xdist, runs them itself."""

    def __init__(self, campaign_session: Session | None = None) -> None:
        self.campaign_session = campaign_session
        self._worker: Worker | None = None  # of this process
        self._worker_continuer: WorkerContinuer | None = None

    @pytest.hookimpl(optionalhook=True)
    def pytest_xdist_setupnodes(self, specs: Sequence[Any]) -> None:
        self._worker_continuer = WorkerContinuer()
        for spec in specs:
            if spec.popen and not spec.python:
                spec.python = shlex.join(python_command_dying_with(os.getpid()))

    @pytest.hookimpl(optionalhook=True)
    def pytest_configure_node(self, node: Any) -> None:
        assert self.campaign_session is not None
        begun = self.campaign_session
        start = begun.start_of_worker(node.gateway.id)
        node.workerinput[INPUT_KEY] = {
            "start": start.to_bytes(),
            "pending": [[item.chunk_index, list(item.pending_positions)] for item in begun.pending],
            "proof": [[sample.number, sample.id] for sample in begun.proof],
        }

    @pytest.hookimpl(optionalhook=True)
    def pytest_xdist_make_scheduler(self, config: pytest.Config, log: Any) -> PieceScheduling | None:
        if is_scheduler_chosen(config):
            return None
        assert self.campaign_session is not None
        folder, pending = self.campaign_session.folder, self.campaign_session.pending
        keys = golden_key_by_chunk(folder, pending)
        golden_key_by_node_id = {node_id_of(work): keys[work.chunk_index] for work in pending}
        return PieceScheduling(config, log, golden_key_by_node_id.get)

    @pytest.hookimpl(optionalhook=True)
    def pytest_testnodedown(self, node: Any, error: object | None) -> None:
        if error:
            self._note_problem(f"worker {node.gateway.id} died: {error}")
        assert self.campaign_session is not None
        output = getattr(node, "workeroutput", {})
        self._note_problem(output.get(PROBLEM_KEY, ""))
        if WRITTEN_KEY in output:
            session = self.campaign_session
            session.written.add_report(output[WRITTEN_KEY], session.worker_prefix + node.gateway.id)

    def pytest_collection(self, session: pytest.Session) -> bool | None:
        if session.config.pluginmanager.hasplugin("dsession"):
            return None  # xdist's hook collects nothing in this process
        assert self.campaign_session is not None
        begun = self.campaign_session
        return collect_items(session, (*begun.pending, *begun.proof), self._ensure_worker)

    def _ensure_worker(self) -> Worker:
        begun = self.campaign_session
        assert begun is not None
        if self._worker is None:
            self._worker = Worker(begun.inputs, begun.worker_assignment("main"))
        return self._worker

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        self._note_problem(str(dict(report.user_properties).get(PROBLEM_KEY, "")))

    def pytest_keyboard_interrupt(self, excinfo: pytest.ExceptionInfo[BaseException]) -> None:
        if self.campaign_session is None:
            return
        if type(excinfo.value) is KeyboardInterrupt:  # pytest's own exceptions mean a regular stop
            self.campaign_session.interrupted = True
        # workers ignore Ctrl-C, and xdist would wait for their chunks
        for pid in living_worker_pids(self.campaign_session.folder.path):
            os.kill(pid, signal.SIGTERM)

    def pytest_internalerror(self, excinfo: pytest.ExceptionInfo[BaseException]) -> None:
        self._note_problem(str(find_shortage(excinfo.value) or ""))

    @pytest.hookimpl(trylast=True)  # after xdist has ended its workers
    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        if self._worker is not None and self.campaign_session is not None:
            self._worker.close()
            self.campaign_session.written.add_report(self._worker.file_digests)
            self._worker = None
        if self._worker_continuer is not None:
            self._worker_continuer.end()

    def _note_problem(self, problem: str) -> None:
        if (
            self.campaign_session
            and problem
            and not self.campaign_session.problem
            and not self.campaign_session.interrupted
        ):
            self.campaign_session.problem = problem


class StandaloneController(CampaignController):
    """Controller for a user's pytest command: also plans, checks, and prints the summary."""

    def __init__(
        self,
        campaign: str,
        out: Path,
        *,
        reviewed: bool,
        accept_versions: bool,
        sandbox: bool,
        reuse: bool,
        distributor: "WorkDistributor | None" = None,
        packages: Sequence[str] = (),
    ) -> None:
        super().__init__()
        self._reuse = reuse
        self._distributor = distributor
        self._packages = packages
        self._campaign = campaign
        self._reviewed = reviewed
        self._accept_versions = accept_versions
        self._sandbox = sandbox
        self._out = out
        self._open = ExitStack()
        self._closing_lines: list[str] = []

    @pytest.hookimpl(tryfirst=True)
    def pytest_sessionstart(self, session: pytest.Session) -> None:
        workers = getattr(session.config.option, "numprocesses", None) or 0
        try:
            opened = open_session(
                Workspace.find(sandbox=self._sandbox),
                self._campaign,
                self._out,
                workers=workers,
                choices=Choices(),
                reviewed=self._reviewed,
                accept_versions=self._accept_versions,
                reuse=self._reuse,
                notify=_progress_notifier(session.config),
            )
            self.campaign_session = self._open.enter_context(opened)
            self.campaign_session.prepare(self._packages)
        except MutatorError as err:
            self._open.close()
            self.campaign_session = None
            print(err, file=sys.stderr)  # pytest would print the reason twice
            pytest.exit("no campaign was run", returncode=err.exit_code)

    def pytest_collection(self, session: pytest.Session) -> bool | None:
        if self._distributor is None or self.campaign_session is None:
            return super().pytest_collection(session)
        session.items = []
        if self.campaign_session.pending or self.campaign_session.proof:
            item = DistributedItem.from_parent(
                session,
                name="cluster",
                nodeid="campaign::cluster",
                campaign_session=self.campaign_session,
                distributor=self._distributor,
            )
            session.items.append(item)
        session.testscollected = len(session.items)
        session.config.hook.pytest_collection_finish(session=session)
        return True

    @pytest.hookimpl(trylast=True)
    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        if self.campaign_session is None:
            return
        try:
            super().pytest_sessionfinish(session)
            summary = self.campaign_session.finish()
            self._closing_lines = _summary_lines(summary)
            if not summary.interrupted:
                session.exitstatus = summary.exit_code
        except MutatorError as err:
            self._closing_lines = [str(err)]
            session.exitstatus = err.exit_code
        finally:
            self._open.close()

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        if self._closing_lines:
            terminalreporter.section("campaign")
        for line in self._closing_lines:
            terminalreporter.write_line(line)


def _progress_notifier(config: pytest.Config) -> ProgressCallback | None:
    reporter = config.pluginmanager.get_plugin("terminalreporter")
    if reporter is None or config.get_verbosity() < 0:
        return None

    def write(line: str) -> None:
        reporter.ensure_newline()
        reporter.write_line(line)

    return ProgressLines(write)


def _summary_lines(summary: Summary) -> list[str]:
    lines = [
        f"{summary.done} of {summary.planned} experiments done, {summary.ran} now",
        summary.reuse_note,
        ", ".join(f"{name} {count}" for name, count in sorted(summary.outcomes.items())),
        summary.problem,
        *(f"{name}: {what}" for name, what in summary.harness_errors),
        f"proof: {summary.proof_note}" if summary.proof_note else "",
        f"results: {summary.results}" if summary.results else "",
        *(f"{name}: {value}" for name, value in summary.seals.digest_by_name().items()),
    ]
    return [line for line in lines if line]
