"""Campaigns as pytest sessions: controller, xdist workers, and items (chunks)."""

import os
import shlex
import signal
import sys
import traceback
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Protocol

import pytest

from mutator._common.files import raising_disk_full
from mutator._common.locks import living_workers, register_worker
from mutator._common.shortages import shortage
from mutator.campaigns.chunks import Pending
from mutator.campaigns.plans import Choices
from mutator.errors import DiskFull, HarnessErrors, MutatorError, Shortage
from mutator.execution.following import followed
from mutator.execution.phases import Lines
from mutator.execution.session import Notify, Session, Summary, open_session
from mutator.execution.stopped_workers import Continuing, on_stop
from mutator.execution.worker import Assignment, Worker, bind_to_parent, dying_python
from mutator.execution.written_files import Sums
from mutator.preflight.equivalence import Sample
from mutator.workspace import Workspace

_INPUT = "mutator_campaign"
_PROBLEM = "mutator_problem"
_WRITTEN = "mutator_written"


class Deals(Protocol):
    def run(self, session: Session) -> None: ...


class CampaignItem(pytest.Item):
    """An item that does part of a campaign's work. It fails only for harness errors."""

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: Any = None) -> Any:
        if isinstance(excinfo.value, HarnessErrors | MutatorError):
            return str(excinfo.value)
        return super().repr_failure(excinfo, style)

    def reportinfo(self) -> tuple[Path, None, str]:
        return self.config.rootpath, None, self.name


class WorkItem(CampaignItem):
    """One chunk of the plan, or one experiment of the proof. A hazard is a result, not a failure."""

    def __init__(self, *, work: Pending | Sample, worker: "LazyWorker", **keywords: Any) -> None:
        super().__init__(**keywords)
        self.work = work
        self.worker = worker

    def runtest(self) -> None:
        try:
            with raising_disk_full(self.config.rootpath):
                worker, work = self.worker.get(), self.work
                errors = worker.run(work) if isinstance(work, Pending) else worker.prove(work)
        except Exception as err:
            known = err if isinstance(err, MutatorError) else shortage(err)
            problem = str(known) if known else _defect(err, self.name)
            self.user_properties.append((_PROBLEM, problem))
            if isinstance(known, DiskFull | Shortage):
                self.session.shouldstop = problem
            raise
        if errors:
            raise HarnessErrors("\n".join(f"{name}: {detail}" for name, detail in errors))


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


def _defect(err: Exception, chunk: str) -> str:
    lines = "".join(traceback.format_exception(err))
    return (
        f"{chunk} failed because of a defect in mutator; please report it with these lines:\n{lines}".rstrip()
    )


class LazyWorker:
    """The worker of this process, made when the first chunk runs, because collection does not need it."""

    def __init__(self, workspace: Workspace, assignment: Assignment) -> None:
        self._workspace = workspace
        self._assignment = assignment
        self._worker: Worker | None = None

    def get(self) -> Worker:
        if self._worker is None:
            self._worker = Worker(self._workspace, self._assignment)
        return self._worker

    def note_stop(self) -> None:
        """Note that this process was stopped and continued."""
        if self._worker is not None:
            self._worker.was_stopped = True

    def close(self) -> Sums:
        """Close the worker's files; return their digests."""
        worker, self._worker = self._worker, None
        if worker is None:
            return {}
        worker.close()
        return worker.written


def configure(
    config: pytest.Config,
    campaign: str,
    out: Path,
    *,
    reviewed: bool,
    accept_versions: bool,
    sandbox: bool,
    distributor: "Deals | None" = None,
) -> None:
    """Register the plugin for this process's role.

    Workers take items one by one, even if the user's configuration groups tests, for example by file. With a
    `distributor`, pytest itself distributes nothing.
    """
    if getattr(config.option, "dist", "no") != "no":
        config.option.dist = "load"
    given = getattr(config, "workerinput", {}).get(_INPUT)
    if given is not None:
        config.pluginmanager.register(WorkerSide(config, given, config.workerinput["workerid"]))  # type: ignore[attr-defined]
    elif not any(isinstance(plugin, Controller) for plugin in config.pluginmanager.get_plugins()):
        config.pluginmanager.register(
            PlainController(
                campaign,
                out,
                reviewed=reviewed,
                accept_versions=accept_versions,
                sandbox=sandbox,
                distributor=distributor,
            )
        )


def _collect(session: pytest.Session, works: Sequence[Pending | Sample], worker: LazyWorker) -> bool:
    """Make the session's items: chunks, then experiments of the proof.

    The proof has the smallest items and comes last, so that the workers finish at about the same time.
    """
    session.items = []
    for work in works:
        name = f"chunk-{work.chunk:05d}" if isinstance(work, Pending) else f"proof-{work.number:05d}"
        session.items.append(
            WorkItem.from_parent(session, name=name, nodeid=f"campaign::{name}", work=work, worker=worker)
        )
    session.testscollected = len(session.items)
    session.config.hook.pytest_collection_finish(session=session)
    return True


class WorkerSide:
    """Plugin of an xdist worker: collects the pending work, and runs the items that it receives."""

    def __init__(self, config: pytest.Config, given: dict[str, Any], worker_id: str) -> None:
        bind_to_parent(given["parent"])
        run, places = Path(given["run"]), given["workspace"]
        workspace = Workspace(
            library=Path(places["library"]),
            templates=Path(places["templates"]),
            target=Path(places["target"]) if places["target"] else None,
            sandbox=bool(places["sandbox"]),
        )
        assignment = Assignment(
            run=run,
            name=given["session"] + worker_id,
            engine=given["engine"],
            goldens=given["goldens"],
            secret=given["secret"],
            parent=given["parent"],
        )
        self._config = config
        self._registration = register_worker(run)
        self._work: list[Pending | Sample] = [
            *(Pending(chunk, tuple(places)) for chunk, places in given["pending"]),
            *(Sample(number, name) for number, name in given["proof"]),
        ]
        self._worker = LazyWorker(workspace, assignment)
        on_stop(self._worker.note_stop)

    def pytest_collection(self, session: pytest.Session) -> bool:
        return _collect(session, self._work, self._worker)

    def pytest_sessionfinish(self) -> None:
        try:
            written = self._worker.close()
            self._config.workeroutput[_WRITTEN] = dict(written)  # type: ignore[attr-defined]
        except MutatorError as err:
            self._config.workeroutput[_PROBLEM] = str(err)  # type: ignore[attr-defined]
        os.close(self._registration)


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
        worker_input = node.workerinput[_INPUT] = self.begun.worker_input()
        self.begun.written.begin(worker_input["session"] + node.gateway.id)

    @pytest.hookimpl(optionalhook=True)
    def pytest_testnodedown(self, node: Any, error: object | None) -> None:
        if error:
            self._note(f"worker {node.gateway.id} died: {error}")
        assert self.begun is not None
        output, given = getattr(node, "workeroutput", {}), node.workerinput[_INPUT]
        self._note(output.get(_PROBLEM, ""))
        if _WRITTEN in output:
            self.begun.written.report(output[_WRITTEN], given["session"] + node.gateway.id)

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
        self._worker = LazyWorker(begun.workspace, assignment)
        return _collect(session, (*begun.pending, *begun.proof), self._worker)

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        self._note(str(dict(report.user_properties).get(_PROBLEM, "")))

    def pytest_keyboard_interrupt(self, excinfo: pytest.ExceptionInfo[BaseException]) -> None:
        if self.begun is None:
            return
        if type(excinfo.value) is KeyboardInterrupt:  # pytest's own exceptions mean a regular stop
            self.begun.interrupted = True
        for pid in living_workers(self.begun.folder.path):
            os.kill(pid, signal.SIGTERM)

    def pytest_internalerror(self, excinfo: pytest.ExceptionInfo[BaseException]) -> None:
        self._note(str(shortage(excinfo.value) or ""))

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
    ) -> None:
        super().__init__()
        self._distributor = distributor
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
            self.begun.prepare()
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
        *(f"{name}: {value}" for name, value in summary.seals.texts().items()),
    ]
    return [line for line in lines if line]
