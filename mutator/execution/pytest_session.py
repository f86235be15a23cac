"""Campaigns as pytest sessions: the controller, whose xdist workers have `pytest_worker`."""

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
from mutator.errors import HarnessErrors, MutatorError
from mutator.execution.progress_reporting import followed
from mutator.execution.progress_text import Lines
from mutator.execution.pytest_worker import INPUT, PROBLEM, WRITTEN, CampaignItem, LazyWorker, collect
from mutator.execution.session import Notify, Session, Summary, open_session
from mutator.execution.stopped_workers import Continuing
from mutator.execution.worker import Assignment, dying_python
from mutator.store.plan_choices import Choices
from mutator.workspace import Workspace


class Deals(Protocol):
    def run(self, session: Session) -> None: ...


class DealItem(CampaignItem):
    """All of a session's work, done by a cluster."""

    def __init__(self, *, begun: Session, distributor: Deals, **keywords: Any) -> None:
        super().__init__(**keywords)
        self._begun, self._distributor = begun, distributor

    def runtest(self) -> None:
        with followed(self._begun):
            self._distributor.run(self._begun)
        if self._begun.interrupted:
            raise KeyboardInterrupt
        if self._begun.problem:
            raise HarnessErrors(self._begun.problem)


def configure(
    config: pytest.Config,
    campaign: str,
    out: Path,
    *,
    reviewed: bool,
    accept_versions: bool,
    sandbox: bool,
    distributor: "Deals | None" = None,
    packages: Sequence[str] = (),
) -> None:
    """Register the plugin of the process that is no worker.

    Workers take items one by one, even if the user's configuration groups tests, for example by file. With a
    `distributor`, pytest itself distributes nothing; `packages` are what it comes from.
    """
    if getattr(config.option, "dist", "no") != "no":
        config.option.dist = "load"
    if not any(isinstance(plugin, Controller) for plugin in config.pluginmanager.get_plugins()):
        config.pluginmanager.register(
            PlainController(
                campaign,
                out,
                reviewed=reviewed,
                accept_versions=accept_versions,
                sandbox=sandbox,
                distributor=distributor,
                packages=packages,
            )
        )


class Controller:
    """Plugin of the controller: distributes chunks or, without xdist, runs them itself."""

    def __init__(self, begun: Session | None = None) -> None:
        self.begun = begun
        self._worker: LazyWorker | None = None
        self._continuing: Continuing | None = None

    @pytest.hookimpl(optionalhook=True)
    def pytest_xdist_setupnodes(self, specs: Sequence[Any]) -> None:
        self._continuing = Continuing()
        for spec in specs:
            if spec.popen and not spec.python:
                spec.python = shlex.join(dying_python(os.getpid()))

    @pytest.hookimpl(optionalhook=True)
    def pytest_configure_node(self, node: Any) -> None:
        assert self.begun is not None
        worker_input = node.workerinput[INPUT] = self.begun.worker_input()
        self.begun.written.begin(worker_input["session"] + node.gateway.id)

    @pytest.hookimpl(optionalhook=True)
    def pytest_testnodedown(self, node: Any, error: object | None) -> None:
        if error:
            self._note(f"worker {node.gateway.id} died: {error}")
        assert self.begun is not None
        output, given = getattr(node, "workeroutput", {}), node.workerinput[INPUT]
        self._note(output.get(PROBLEM, ""))
        if WRITTEN in output:
            self.begun.written.report(output[WRITTEN], given["session"] + node.gateway.id)

    def pytest_collection(self, session: pytest.Session) -> bool | None:
        if session.config.pluginmanager.hasplugin("dsession"):
            return None  # xdist's hook collects nothing in this process
        assert self.begun is not None
        begun = self.begun
        name = begun.worker_name("main")
        assignment = Assignment(
            run=begun.folder.path,
            name=name,
            engine=begun.engine,
            goldens=begun.golden_digests,
            secret=begun.secret,
        )
        self._worker = LazyWorker(lambda: begun.inputs, assignment)
        return collect(session, (*begun.pending, *begun.proof), self._worker)

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        self._note(str(dict(report.user_properties).get(PROBLEM, "")))

    def pytest_keyboard_interrupt(self, excinfo: pytest.ExceptionInfo[BaseException]) -> None:
        if self.begun is None:
            return
        if type(excinfo.value) is KeyboardInterrupt:  # pytest's own exceptions mean a regular stop
            self.begun.interrupted = True
        for pid in living_worker_pids(self.begun.folder.path):
            os.kill(pid, signal.SIGTERM)

    def pytest_internalerror(self, excinfo: pytest.ExceptionInfo[BaseException]) -> None:
        self._note(str(find_shortage(excinfo.value) or ""))

    @pytest.hookimpl(trylast=True)  # after xdist has ended its workers
    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        if self._worker is not None and self.begun is not None:
            self.begun.written.report(self._worker.close())
        if self._continuing is not None:
            self._continuing.end()

    def _note(self, problem: str) -> None:
        if self.begun and problem and not self.begun.problem and not self.begun.interrupted:
            self.begun.problem = problem


class PlainController(Controller):
    """Controller for a user's pytest command: also plans, checks, and prints the summary."""

    def __init__(
        self,
        campaign: str,
        out: Path,
        *,
        reviewed: bool,
        accept_versions: bool,
        sandbox: bool,
        distributor: "Deals | None" = None,
        packages: Sequence[str] = (),
    ) -> None:
        super().__init__()
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
                notify=_told(session.config),
            )
            self.begun = self._open.enter_context(opened)
            self.begun.prepare(self._packages)
        except MutatorError as err:
            self._open.close()
            self.begun = None
            print(err, file=sys.stderr)  # pytest would print the reason twice
            pytest.exit("no campaign was run", returncode=err.exit_code)

    def pytest_collection(self, session: pytest.Session) -> bool | None:
        if self._distributor is None or self.begun is None:
            return super().pytest_collection(session)
        session.items = []
        if self.begun.pending or self.begun.proof:
            item = DealItem.from_parent(
                session,
                name="cluster",
                nodeid="campaign::cluster",
                begun=self.begun,
                distributor=self._distributor,
            )
            session.items.append(item)
        session.testscollected = len(session.items)
        session.config.hook.pytest_collection_finish(session=session)
        return True

    @pytest.hookimpl(trylast=True)
    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        if self.begun is None:
            return
        try:
            super().pytest_sessionfinish(session)
            summary = self.begun.finish()
            self._closing_lines = _lines(summary)
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


def _told(config: pytest.Config) -> Notify | None:
    reporter = config.pluginmanager.get_plugin("terminalreporter")
    if reporter is None or config.get_verbosity() < 0:
        return None

    def write(line: str) -> None:
        reporter.ensure_newline()
        reporter.write_line(line)

    return Lines(write)


def _lines(summary: Summary) -> list[str]:
    lines = [
        f"{summary.done} of {summary.planned} experiments done, {summary.ran} now",
        ", ".join(f"{name} {count}" for name, count in sorted(summary.outcomes.items())),
        summary.problem,
        *(f"{name}: {what}" for name, what in summary.harness_errors),
        f"proof: {summary.proof_note}" if summary.proof_note else "",
        f"results: {summary.results}" if summary.results else "",
        *(f"{name}: {value}" for name, value in summary.seals.digest_by_name().items()),
    ]
    return [line for line in lines if line]
