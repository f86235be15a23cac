"""Distribute work through Dask, which carries the bytes and knows which workers are present.

The board decides which worker runs which piece. A worker has at most two tasks per thread. A finished task is
released immediately.
"""

import asyncio
import time
import uuid
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

from distributed import Client, Future

from mutator._common.typed_json import from_json_types
from mutator.errors import DiskFull, MutatorError, SchedulerGone, WorkerCutOff, WorkerRefused
from mutator.execution.cluster import worker_tasks
from mutator.execution.cluster.bundle import Bundle
from mutator.execution.cluster.crew import Crew, describe
from mutator.execution.cluster.piece_queue import Board
from mutator.execution.cluster.pieces import Ending, Piece, Result
from mutator.execution.cluster.result_intake import Intake
from mutator.execution.cluster.worker_calls import answer, call, submit
from mutator.execution.session import Session
from mutator.preflight import equivalence_check
from mutator.store.work_stretches import Machine

_LOOK_S = 0.5  # between two checks of the present workers
_ALONE_S = 60.0  # time without any worker after which the command gives up
_AHEAD = 2  # pieces per thread of a worker: one waits while the other runs
_FAILURES = 3  # consecutive failures after which a worker gets no more work
_PAUSE_S = 0.1  # pause before an idle worker asks again
_PART_S = 5.0  # time for workers to drop the run
_PATIENCE_S = 30.0  # time for the scheduler to answer


@dataclass
class _Tended:
    """A present worker and its pieces, oldest first."""

    name: str
    address: str
    slots: int
    lease: "Future[None] | None" = None  # the task `attend`
    task: "asyncio.Task[None] | None" = None
    has: dict[int, Piece] = field(default_factory=dict)
    is_cut: bool = False  # the scheduler dropped its tasks, so it must be admitted again
    failures: int = 0  # since the worker's last finished piece
    ailment: str = ""  # reason for the last failure
    facts: Mapping[str, Any] = field(default_factory=dict)  # empty once they are in run.json


class Deal:
    """Distributes the work of a session to the workers of a scheduler.

    `remark` is called with messages for the user. `queued` is how many workers are expected; None if unknown.
    """

    def __init__(
        self, session: Session, client: Client, remark: Callable[[str], None], *, queued: int | None
    ) -> None:
        self._session, self._client, self._remark, self._queued = session, client, remark, queued
        folder = session.folder
        self._bundle = Bundle.of(session.workspace, folder, session.engine)
        self._board = Board(folder, session.pending, session.proof)
        self._intake = Intake(folder, session.manifest, session.worker_name("cluster"))
        self._crew = Crew(folder.stretches[-1], accept=session.accept_versions)
        self._run = f"mutator-{uuid.uuid4().hex}"
        self._tended: dict[str, _Tended] = {}
        self._changed = asyncio.Event()  # set when idle workers might find work
        self._writing = asyncio.Lock()
        self._writes: set[asyncio.Task[None]] = set()
        self._forked = False
        self._alone_since = time.monotonic()

    async def run(self) -> None:
        try:
            while not (self._board.is_empty and not self._writes) and not self._session.problem:
                await self._meet()
                self._drop_needless_proof()
                self._session.working = self._told()
                with suppress(TimeoutError):
                    await asyncio.wait_for(self._changed.wait(), _LOOK_S)
                self._changed.clear()
        except SchedulerGone:
            self._session.problem = (
                f"the scheduler at {self._address} no longer answers, but finished work is stored; "
                "start the scheduler and its workers again, then run the same command"
            )
        except DiskFull as err:
            self._session.problem = str(err)
        finally:
            tasks = [one.task for one in self._tended.values() if one.task is not None]
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
            await self._part()
            self._session.working = ""
            await asyncio.gather(*self._writes, return_exceptions=True)
            self._session.written.report(self._intake.close())

    async def _part(self) -> None:
        """Tell the workers to drop the run. Workers that do not answer drop it once the client is gone."""
        present = [one for one in self._tended.values() if one.lease is not None]
        parting = [call(self._client, one.address, worker_tasks.leave, self._run) for one in present]
        with suppress(TimeoutError):
            async with asyncio.timeout(_PART_S):
                await asyncio.gather(*parting, return_exceptions=True)
        for one in present:
            if one.lease is not None:
                one.lease.release()

    @property
    def _address(self) -> str:
        return str(self._client.scheduler.address) if self._client.scheduler else "its address"

    def _told(self) -> str:
        link = self._client.dashboard_link
        return self._crew.told() + (f"; {link}" if link else "")

    async def _meet(self) -> None:
        try:
            async with asyncio.timeout(_PATIENCE_S):
                scheduler = self._client.scheduler
                known = await scheduler.identity(n_workers=-1) if scheduler is not None else None
        except (OSError, TimeoutError):
            known = None
        if known is None:
            raise SchedulerGone
        there = {f"{address} {one['id']}": one for address, one in known["workers"].items()}
        for key in [key for key, one in self._tended.items() if key not in there or one.is_cut]:
            await self._mourn(self._tended.pop(key))
        for key in there.keys() - self._tended.keys():
            address, told = key.partition(" ")[0], there[key]
            name = str(told["name"])
            name = name if name == address else f"{name} at {address}"
            one = _Tended(name, address, int(told["nthreads"]))
            one.task = asyncio.create_task(self._tend(one))
            self._tended[key] = one
        for one in self._tended.values():
            if one.task is not None and one.task.done():
                one.task.result()  # raises the error that ended the task
        self._check_left()

    async def _mourn(self, one: _Tended) -> None:
        """Handle a lost worker. A piece that it was running might be the cause; a waiting piece cannot be."""
        assert one.task is not None
        one.task.cancel()
        await asyncio.gather(one.task, return_exceptions=True)
        for place, piece in enumerate(one.has.values()):
            if place < one.slots:
                lost = Result(number=piece.number, ending=Ending.DIED, text=f"worker {one.name} was lost")
                await self._died(piece, one, lost)
            else:
                self._board.give_back(piece, one.name)

    def _check_left(self) -> None:
        if any(one.task is not None and not one.task.done() for one in self._tended.values()):
            self._alone_since = time.monotonic()
        elif len(self._tended) >= (self._queued or 1):
            reasons = "; ".join(dict.fromkeys(self._crew.refused.values()))
            self._session.problem = f"no worker is left to do the work: {reasons}"
        elif self._queued is None and time.monotonic() - self._alone_since > _ALONE_S:
            self._session.problem = (
                f"no worker at {self._address} for {_ALONE_S:.0f} s; start workers (`dask worker`), then run "
                "the same command"
            )

    def _drop_needless_proof(self) -> None:
        if self._board.ran_all and self._session.proof and not self._forked:
            self._forked = True  # so that this is computed only once
            if equivalence_check.reason_not_needed(self._session.folder) is not None:
                self._board.drop_proof()

    async def _tend(self, one: _Tended) -> None:
        """Admit a worker, and give it work while it is present."""
        facts: Mapping[str, Any] = {}
        try:
            facts = await call(self._client, one.address, worker_tasks.facts, tuple(self._crew.packages))
            if why := self._crew.objection(facts):
                raise WorkerRefused(why)
            data, digest = self._bundle.data, self._bundle.digest
            await call(self._client, one.address, worker_tasks.deliver, self._run, one.name, data, digest)
            one.lease = submit(self._client, one.address, worker_tasks.attend, self._run)
            self._crew.let_in(one.name, facts)
            self._board.join(one.name, one.slots)
            one.facts = facts
            await self._employ(one, one.lease)
        except WorkerRefused as why:
            for piece in one.has.values():
                self._board.give_back(piece, one.name)
            one.has.clear()
            one.is_cut = isinstance(why, WorkerCutOff)
            if not one.is_cut:
                self._crew.refuse(one.name, str(why))
                self._remark(f"worker {describe(one.name, facts)} gets no work: {why}")
        finally:
            self._crew.leave(one.name)
            self._board.leave(one.name)
            self._changed.set()

    async def _employ(self, one: _Tended, lease: "Future[None]") -> None:
        """Give a worker pieces until this task is cancelled, or the worker leaves the run."""

        async def watch() -> None:
            await answer(lease)
            raise WorkerRefused("it left the run")

        try:
            async with asyncio.TaskGroup() as group:
                group.create_task(watch())
                for _ in range(one.slots * _AHEAD):
                    group.create_task(self._serve(one))
        except* WorkerRefused as found:
            raise found.exceptions[0] from None
        except* MutatorError as found:
            raise found.exceptions[0] from None

    async def _serve(self, one: _Tended) -> None:
        while True:
            if one.failures >= _FAILURES:
                raise WorkerRefused(one.ailment)
            piece = self._board.take(one.name, ahead=len(one.has) >= one.slots)
            if piece is None:
                await asyncio.sleep(_PAUSE_S)
                continue
            one.has[piece.number] = piece
            data = await call(self._client, one.address, worker_tasks.work, self._run, piece.packed())
            del one.has[piece.number]
            await self._take(one, piece, _read(data, piece))

    async def _take(self, one: _Tended, piece: Piece, result: Result) -> None:
        if result.ending is Ending.DONE:
            one.failures = 0
            if self._board.done(piece, one.name, result.seconds):
                await self._done(piece, one, result)
            self._changed.set()
            return
        one.ailment = result.text
        if result.ending in (Ending.DIED, Ending.FAILED):
            await self._died(piece, one, result)
            return
        self._board.give_back(piece, one.name)
        one.failures += 1
        if result.ending is Ending.UNLIKE:
            raise WorkerRefused(result.text)

    async def _done(self, piece: Piece, one: _Tended, result: Result) -> None:
        if one.facts:  # before its first results are written, run.json must name the worker
            self._session.note_machine(from_json_types(Machine, {"worker": one.name, **one.facts}))
            one.facts = {}
        for other in self._tended.values():  # the piece ran here, so it did not cause the failures elsewhere
            other.failures += other.name in piece.died_at and other is not one
        self._forked |= result.forked
        self._crew.finished(one.name, len(piece.lines))
        await self._write(self._intake.take, piece, result)

    async def _died(self, piece: Piece, one: _Tended, result: Result) -> None:
        if (given_up := self._board.died(piece, one.name, result.at)) is not None:
            what = "takes down what runs it, and did so" if result.ending is Ending.DIED else "failed"
            await self._write(self._intake.give_up, given_up, f"{what} twice: {result.text}")

    async def _write(self, function: Callable[[Piece, Any], None], piece: Piece, what: Any) -> None:
        """Write into the run folder, one write at a time. Cancellation does not interrupt a write."""

        async def in_turn() -> None:
            async with self._writing:
                await asyncio.to_thread(function, piece, what)

        write = asyncio.create_task(in_turn())
        self._writes.add(write)
        write.add_done_callback(self._writes.discard)
        await asyncio.shield(write)


def _read(data: bytes, piece: Piece) -> Result:
    try:
        return Result.of(data)
    except MutatorError as err:
        return Result(number=piece.number, ending=Ending.UNFIT, text=str(err))
