"""Distribute work through Dask, which carries the bytes and knows which workers are present.

The queue decides which worker runs which piece. A worker has at most two tasks per thread. A finished task is
released immediately.
"""

import asyncio
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

from distributed import Future

from mutator._common.typed_json import typed_value_from_json
from mutator.errors import DiskFull, MutatorError, SchedulerGone, WorkerCutOff, WorkerRefused
from mutator.execution.cluster import worker_tasks
from mutator.execution.cluster.attending_workers import AttendingWorker, AttendingWorkers
from mutator.execution.cluster.piece_messages import Piece, PieceEnding, PieceResult
from mutator.execution.cluster.piece_queue import PieceQueue
from mutator.execution.cluster.result_intake import ResultIntake
from mutator.execution.cluster.worker_calls import await_answer, submit_to_worker
from mutator.execution.cluster.worker_roster import WorkerRoster, describe_worker
from mutator.execution.session import Session
from mutator.preflight import equivalence_check
from mutator.store.session_environments import WorkerMachine

_WORKER_CHECK_INTERVAL_S = 0.5  # between two checks of the present workers
_WORKERLESS_TIMEOUT_S = 60.0  # time without any worker after which the command gives up
_MOST_TASKS_PER_SLOT = 2  # pieces per thread of a worker: one waits while the other runs
_MOST_FAILURES_IN_A_ROW = 3  # consecutive failures after which a worker gets no more work
_IDLE_PAUSE_S = 0.1  # pause before an idle worker asks again
_SCHEDULER_TIMEOUT_S = 30.0  # time for the scheduler to answer


@dataclass
class _PresentWorker:
    """A present worker and its pieces, oldest first."""

    attending: AttendingWorker
    slots: int
    serving_task: "asyncio.Task[None] | None" = None
    pieces_by_number: dict[int, Piece] = field(default_factory=dict)
    was_cut_off: bool = False  # it must be admitted again
    was_refused: bool = False
    failures_in_a_row: int = 0  # since the worker's last finished piece
    last_failure: str = ""  # reason for the last failure

    @property
    def name(self) -> str:
        return self.attending.name


class WorkDispatcher:
    """Distributes the pending work of a session to the workers of a scheduler. Those in `attending` attend
    the run already, and stay when all is done.

    `remark` is called with messages for the user. `expected_workers` is a number; None if unknown.
    """

    def __init__(
        self,
        session: Session,
        attending: AttendingWorkers,
        remark: Callable[[str], None],
        *,
        expected_workers: int | None,
    ) -> None:
        self._session, self._attending, self._remark = session, attending, remark
        self._client, self._expected_workers = attending.client, expected_workers
        folder = session.folder
        self._queue = PieceQueue(folder, session.pending, session.proof)
        self._intake = ResultIntake(folder, session.manifest, session.unused_worker_name("cluster"))
        self._roster = WorkerRoster(folder.session_environments[-1], accept=session.accept_versions)
        self._workers_by_key: dict[str, _PresentWorker] = {}
        self._queue_changed = asyncio.Event()  # set when idle workers might find work
        self._write_lock = asyncio.Lock()
        self._pending_writes: set[asyncio.Task[None]] = set()
        self._is_proof_need_settled = False
        self._without_workers_since = time.monotonic()

    async def run(self) -> None:
        try:
            while not (self._queue.is_empty and not self._pending_writes) and not self._session.problem:
                await self._update_workers()
                self._drop_unneeded_proof()
                self._session.workers_note = self._describe_workers()
                with suppress(TimeoutError):
                    await asyncio.wait_for(self._queue_changed.wait(), _WORKER_CHECK_INTERVAL_S)
                self._queue_changed.clear()
        except SchedulerGone:
            self._session.problem = (
                f"the scheduler at {self._address} no longer answers, but finished work is stored; "
                "start the scheduler and its workers again, then run the same command"
            )
        except DiskFull as err:
            self._session.problem = str(err)
        finally:
            tasks = [
                worker.serving_task
                for worker in self._workers_by_key.values()
                if worker.serving_task is not None
            ]
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
            # a refused worker can be fit for the next batch
            refused = [worker.attending for worker in self._workers_by_key.values() if worker.was_refused]
            await self._attending.dismiss(refused)
            self._session.workers_note = ""
            await asyncio.gather(*self._pending_writes, return_exceptions=True)
            self._session.written.add_report(self._intake.close())

    @property
    def _address(self) -> str:
        return str(self._client.scheduler.address) if self._client.scheduler else "its address"

    def _describe_workers(self) -> str:
        link = self._client.dashboard_link
        return self._roster.describe_workers() + (f"; {link}" if link else "")

    async def _update_workers(self) -> None:
        try:
            async with asyncio.timeout(_SCHEDULER_TIMEOUT_S):
                scheduler = self._client.scheduler
                identity = await scheduler.identity(n_workers=-1) if scheduler is not None else None
        except (OSError, TimeoutError):
            identity = None
        if identity is None:
            raise SchedulerGone
        info_by_key = {f"{address} {info['id']}": info for address, info in identity["workers"].items()}
        for key in [
            key
            for key, worker in self._workers_by_key.items()
            if key not in info_by_key or worker.was_cut_off
        ]:
            await self._handle_lost_worker(self._workers_by_key.pop(key))
        for key in info_by_key.keys() - self._workers_by_key.keys():
            address, worker_info = key.partition(" ")[0], info_by_key[key]
            name = str(worker_info["name"])
            name = name if name == address else f"{name} at {address}"
            attending = self._attending.worker(key, name, address)
            worker = _PresentWorker(attending, int(worker_info["nthreads"]))
            worker.serving_task = asyncio.create_task(self._admit_and_employ(worker))
            self._workers_by_key[key] = worker
        for worker in self._workers_by_key.values():
            if worker.serving_task is not None and worker.serving_task.done():
                worker.serving_task.result()  # raises the error that ended the task
        self._check_workers_remain()

    async def _handle_lost_worker(self, worker: _PresentWorker) -> None:
        """Handle a lost worker. A piece that it was running might be the cause; a waiting piece cannot be."""
        assert worker.serving_task is not None
        worker.serving_task.cancel()
        await asyncio.gather(worker.serving_task, return_exceptions=True)
        self._attending.forget(worker.attending)
        for place, piece in enumerate(worker.pieces_by_number.values()):
            if place < worker.slots:
                lost = PieceResult(
                    number=piece.number,
                    ending=PieceEnding.PROCESS_DIED,
                    reason=f"worker {worker.name} was lost",
                )
                await self._handle_death(piece, worker, lost)
            else:
                self._queue.give_back_piece(piece, worker.name)

    def _check_workers_remain(self) -> None:
        if any(
            worker.serving_task is not None and not worker.serving_task.done()
            for worker in self._workers_by_key.values()
        ):
            self._without_workers_since = time.monotonic()
        elif len(self._workers_by_key) >= (self._expected_workers or 1):
            reasons = "; ".join(dict.fromkeys(self._roster.refusal_reasons.values()))
            self._session.problem = f"no worker is left to do the work: {reasons}"
        elif (
            self._expected_workers is None
            and time.monotonic() - self._without_workers_since > _WORKERLESS_TIMEOUT_S
        ):
            self._session.problem = (
                f"no worker at {self._address} for {_WORKERLESS_TIMEOUT_S:.0f} s; start workers "
                "(`dask worker`), then run the same command"
            )

    def _drop_unneeded_proof(self) -> None:
        if self._queue.has_run_all and self._session.proof and not self._is_proof_need_settled:
            self._is_proof_need_settled = True  # so that this is computed only once
            if equivalence_check.reason_check_not_needed(self._session.folder) is not None:
                self._queue.drop_proof_pieces()

    async def _admit_and_employ(self, worker: _PresentWorker) -> None:
        """Admit a worker, and give it work while it is present."""
        attending = worker.attending
        try:
            attendance = await self._attending.ensure_attending(attending, self._session, self._roster)
            self._roster.admit_worker(worker.name, attending.facts)
            self._queue.add_worker(worker.name, worker.slots)
            await self._employ_while_attending(worker, attendance)
        except WorkerRefused as why:
            for piece in worker.pieces_by_number.values():
                self._queue.give_back_piece(piece, worker.name)
            worker.pieces_by_number.clear()
            worker.was_cut_off = isinstance(why, WorkerCutOff)
            attending.cut_off_unneeded_pieces()
            worker.was_refused = not worker.was_cut_off
            if worker.was_refused:
                self._roster.refuse_worker(worker.name, str(why))
                self._remark(f"worker {describe_worker(worker.name, attending.facts)} gets no work: {why}")
        finally:
            self._roster.remove_worker(worker.name)
            self._queue.forget_worker(worker.name)
            self._queue_changed.set()

    async def _employ_while_attending(self, worker: _PresentWorker, attendance: "Future[None]") -> None:
        """Give a worker pieces until this task is cancelled, or the worker leaves the run."""

        async def watch() -> None:
            await await_answer(attendance)
            raise WorkerRefused("it left the run")

        try:
            async with asyncio.TaskGroup() as group:
                group.create_task(watch())
                for _ in range(worker.slots * _MOST_TASKS_PER_SLOT):
                    group.create_task(self._send_pieces(worker))
        except* WorkerRefused as errors:
            raise errors.exceptions[0] from None
        except* MutatorError as errors:
            raise errors.exceptions[0] from None

    async def _send_pieces(self, worker: _PresentWorker) -> None:
        while True:
            if worker.failures_in_a_row >= _MOST_FAILURES_IN_A_ROW:
                raise WorkerRefused(worker.last_failure)
            piece = self._queue.take_piece(worker.name, ahead=len(worker.pieces_by_number) >= worker.slots)
            if piece is None:
                await asyncio.sleep(_IDLE_PAUSE_S)
                continue
            worker.pieces_by_number[piece.number] = piece
            data = await self._run_on_worker(worker.attending, piece)
            del worker.pieces_by_number[piece.number]
            await self._handle_result(worker, piece, _unpack_result(data, piece))

    async def _run_on_worker(self, worker: AttendingWorker, piece: Piece) -> bytes:
        future = submit_to_worker(
            self._client, worker.address, worker_tasks.run_piece, self._attending.run_id, piece.to_bytes()
        )
        try:
            data = await await_answer(future)
        except asyncio.CancelledError:
            worker.unneeded_pieces.append(future)
            raise
        except WorkerRefused:
            future.release()
            raise
        future.release()
        return data

    async def _handle_result(self, worker: _PresentWorker, piece: Piece, result: PieceResult) -> None:
        if result.ending is PieceEnding.FINISHED:
            worker.failures_in_a_row = 0
            if self._queue.finish_piece(piece, worker.name, result.seconds):
                await self._store_result(piece, worker, result)
            self._queue_changed.set()
            return
        worker.last_failure = result.reason
        if result.ending in (PieceEnding.PROCESS_DIED, PieceEnding.HARNESS_FAILED):
            await self._handle_death(piece, worker, result)
            return
        self._queue.give_back_piece(piece, worker.name)
        worker.failures_in_a_row += 1
        if result.ending is PieceEnding.GOLDEN_DIFFERS:
            raise WorkerRefused(result.reason)

    async def _store_result(self, piece: Piece, worker: _PresentWorker, result: PieceResult) -> None:
        if not worker.attending.is_machine_stored:
            # before its first results are written, run.json must name the worker
            facts = {"worker": worker.name, **worker.attending.facts}
            self._session.note_machine(typed_value_from_json(WorkerMachine, facts))
            worker.attending.is_machine_stored = True
        for (
            other
        ) in self._workers_by_key.values():  # the piece ran here, so it did not cause the failures elsewhere
            other.failures_in_a_row += other.name in piece.killed_workers and other is not worker
        self._is_proof_need_settled |= result.needs_proof
        self._roster.note_finished_piece(worker.name, len(piece.plan_lines))
        await self._write_in_turn(self._intake.append_result, piece, result)

    async def _handle_death(self, piece: Piece, worker: _PresentWorker, result: PieceResult) -> None:
        if (
            hopeless := self._queue.requeue_after_death(piece, worker.name, result.running_experiment)
        ) is not None:
            what = (
                "takes down what runs it, and did so"
                if result.ending is PieceEnding.PROCESS_DIED
                else "failed"
            )
            await self._write_in_turn(
                self._intake.append_harness_errors, hopeless, f"{what} twice: {result.reason}"
            )

    async def _write_in_turn(
        self, function: Callable[[Piece, Any], None], piece: Piece, argument: Any
    ) -> None:
        """Write into the run folder, one write at a time. Cancellation does not interrupt a write."""

        async def in_turn() -> None:
            async with self._write_lock:
                await asyncio.to_thread(function, piece, argument)

        write = asyncio.create_task(in_turn())
        self._pending_writes.add(write)
        write.add_done_callback(self._pending_writes.discard)
        await asyncio.shield(write)


def _unpack_result(data: bytes, piece: Piece) -> PieceResult:
    try:
        return PieceResult.from_bytes(data)
    except MutatorError as err:
        return PieceResult(number=piece.number, ending=PieceEnding.WORKER_UNFIT, reason=str(err))
