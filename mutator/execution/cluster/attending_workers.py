"""The workers of a cluster that attend a run, and what each of them has of it.

In a bench, they attend from batch to batch. They are told only what is new.
"""

import asyncio
import uuid
from collections.abc import Collection, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

from distributed import Client, Future

from mutator.errors import WorkerCutOff, WorkerRefused
from mutator.execution.cluster import worker_tasks
from mutator.execution.cluster.bundle import Bundle
from mutator.execution.cluster.worker_calls import call_on_worker, submit_to_worker
from mutator.execution.cluster.worker_roster import WorkerRoster
from mutator.execution.session import Session
from mutator.limits import Limits
from mutator.store.golden_runs import GoldenRun
from mutator.store.run_folder import RunFolder

_LEAVE_TIMEOUT_S = 5.0  # time for workers to drop the run


@dataclass(frozen=True, slots=True)
class _BundleContents:
    """What of a bundle changes when the plan of a bench grows."""

    golden_runs: frozenset[GoldenRun]
    limits: Limits

    @classmethod
    def of(cls, folder: RunFolder) -> "_BundleContents":
        return cls(frozenset(folder.golden_runs), folder.limits)


@dataclass
class AttendingWorker:
    """A worker of a run. `attendance` is the task `attend_run`, None as long as it is not admitted."""

    name: str
    address: str
    facts: Mapping[str, Any] = field(default_factory=dict)  # its machine and software, once it has told them
    compared_packages: Collection[str] = ()  # those whose versions it has told
    attendance: "Future[None] | None" = None
    contents: _BundleContents | None = None  # of the bundle that it has
    is_machine_stored: bool = False  # whether run.json names it
    # pieces that another worker did first: their processes can be used again once these have ended
    unneeded_pieces: "list[Future[bytes]]" = field(default_factory=list)

    def cut_off_unneeded_pieces(self) -> None:
        """End the processes of pieces that nobody waits for."""
        for future in self.unneeded_pieces:
            future.release()
        self.unneeded_pieces.clear()


class AttendingWorkers:
    """Lets workers of a scheduler take part in a run, until `dismiss`."""

    def __init__(self, client: Client) -> None:
        self.client, self.run_id = client, f"mutator-{uuid.uuid4().hex}"
        self._worker_by_key: dict[str, AttendingWorker] = {}
        self._bundle: Bundle | None = None
        self._bundle_contents: _BundleContents | None = None

    def worker(self, key: str, name: str, address: str) -> AttendingWorker:
        """Return the worker of this key, which may attend already."""
        return self._worker_by_key.setdefault(key, AttendingWorker(name, address))

    async def ensure_attending(
        self, worker: AttendingWorker, session: Session, roster: WorkerRoster
    ) -> "Future[None]":
        """Admit a worker, or tell it what is new; return its attendance.

        WorkerRefused for a worker that is unfit, WorkerCutOff for one that must be admitted again.
        """
        if worker.attendance is None:
            await self._check_machine(worker, roster)
            await self._deliver_bundle(worker, session)
            worker.attendance = submit_to_worker(
                self.client, worker.address, worker_tasks.attend_run, self.run_id
            )
        elif worker.attendance.done():
            raise WorkerCutOff("it left the run")
        else:
            try:
                await self._bring_up_to_date(worker, session, roster)
            except WorkerRefused as why:  # if it is unfit, it will not be admitted again
                raise WorkerCutOff(str(why)) from None
        return worker.attendance

    def forget(self, worker: AttendingWorker) -> None:
        """Let a worker go that is lost, or must be admitted again."""
        self._worker_by_key = {
            key: other for key, other in self._worker_by_key.items() if other is not worker
        }
        worker.cut_off_unneeded_pieces()
        if worker.attendance is not None:
            worker.attendance.release()

    async def dismiss(self, workers: Collection[AttendingWorker] | None = None) -> None:
        """Tell workers, by default all, to drop the run. One that does not answer drops it once the client is
        gone.
        """
        leaving = list(self._worker_by_key.values() if workers is None else workers)
        calls = [
            call_on_worker(self.client, worker.address, worker_tasks.leave_run, self.run_id)
            for worker in leaving
            if worker.attendance is not None
        ]
        with suppress(TimeoutError):
            async with asyncio.timeout(_LEAVE_TIMEOUT_S):
                await asyncio.gather(*calls, return_exceptions=True)
        for worker in leaving:
            self.forget(worker)

    async def _check_machine(self, worker: AttendingWorker, roster: WorkerRoster) -> None:
        """Ask a worker for its machine and software; WorkerRefused if they do not suit the run."""
        packages = tuple(roster.packages)
        worker.facts = await call_on_worker(self.client, worker.address, worker_tasks.machine_facts, packages)
        if why := roster.reason_to_refuse(worker.facts):
            raise WorkerRefused(why)
        worker.compared_packages = packages

    async def _deliver_bundle(self, worker: AttendingWorker, session: Session) -> None:
        contents = _BundleContents.of(session.folder)
        if self._bundle is None or self._bundle_contents != contents:
            self._bundle = Bundle.pack_for_run(session.workspace, session.folder, session.engine)
            self._bundle_contents = contents
        await call_on_worker(
            self.client,
            worker.address,
            worker_tasks.deliver_bundle,
            self.run_id,
            worker.name,
            self._bundle.data,
            self._bundle.digest,
        )
        worker.contents = contents

    async def _bring_up_to_date(
        self, worker: AttendingWorker, session: Session, roster: WorkerRoster
    ) -> None:
        """Tell a worker what the bench has needed since it was told last."""
        worker.unneeded_pieces = [future for future in worker.unneeded_pieces if not future.done()]
        contents = _BundleContents.of(session.folder)
        if tuple(roster.packages) != worker.compared_packages:
            await self._check_machine(worker, roster)
        if worker.contents == contents:
            return
        if worker.contents is None or worker.contents.limits != contents.limits:
            await call_on_worker(self.client, worker.address, worker_tasks.leave_run, self.run_id)
            raise WorkerCutOff("its processes have other limits")
        growth = Bundle.pack_growth(session.workspace, session.folder, session.engine)
        await call_on_worker(
            self.client,
            worker.address,
            worker_tasks.deliver_growth,
            self.run_id,
            growth.data,
            growth.digest,
        )
        worker.contents = contents
