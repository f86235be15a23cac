"""The distribution of work to workers that fail in various ways."""

import asyncio
import json
import time
from collections.abc import Callable, Generator, Sequence
from dataclasses import replace
from typing import Any

import pytest
from distributed.client import FutureCancelledError

from mutator.execution.cluster.attending_workers import AttendingWorkers
from mutator.execution.cluster.bundle import Bundle
from mutator.execution.cluster.piece_messages import Piece, PieceEnding, PieceResult
from mutator.execution.cluster.result_intake import ResultIntake
from mutator.execution.cluster.work_dispatcher import WorkDispatcher
from mutator.model import Record, Status
from mutator.store import plan_file
from mutator.store.run_folder import RunFolder

from .loops import run

FACTS = {"host": "here", "cpu": "", "platform": "", "python": "", "mutator": "", "blas": [], "packages": {}}
Work = Callable[[Piece], PieceResult]


def healthy(piece: Piece) -> PieceResult:
    line = {"detail": "", "hazards": [], "max_dev": [], "outcome": "masked", "status": "ok", "tree": ""}
    line |= {"activation": None, "alerts": [], "t_manifest": None, "trace_digest": ""}
    records = [json.dumps({"experiment_id": name} | line, separators=(",", ":")) for name in piece.plan_lines]
    return PieceResult(
        number=piece.number,
        ending=PieceEnding.FINISHED,
        seconds=0.5 * piece.run_count,
        records=tuple(text.encode() for text in records),
    )


def sick(ending: PieceEnding, deadly: str = "") -> Work:
    """Make a worker on which every piece, or only a piece with the experiment `deadly`, has the given
    ending."""

    def work(piece: Piece) -> PieceResult:
        if deadly and deadly not in piece.plan_lines:
            return healthy(piece)
        return PieceResult(
            number=piece.number,
            ending=ending,
            reason="the reason",
            running_experiment=deadly or piece.experiment_ids[0],
        )

    return work


class Answer:
    """A substitute for a Dask future."""

    def __init__(self, future: "asyncio.Future[Any]") -> None:
        self.future = future

    def __await__(self) -> Generator[Any, None, Any]:
        return asyncio.shield(self.future).__await__()  # who no longer waits does not end the task

    def done(self) -> bool:
        return self.future.done()

    def release(self) -> None:
        self.future.cancel()


class Workers:
    """A substitute for a Dask client whose scheduler has the given workers."""

    dashboard_link = None

    def __init__(self, **workers: Work) -> None:
        self.workers, self.scheduler, self.address = workers, self, "here"
        self.seconds: dict[str, float] = {}  # how long each worker takes for a piece
        self.began: list[str] = []  # the worker of each piece that began
        self.cut_at = -1  # once this many pieces have begun, the scheduler forgets this client's tasks
        self.calls: list[str] = []  # what came before and after the pieces, with its worker
        self._open: list[tuple[str, asyncio.Future[Any]]] = []

    async def identity(self, n_workers: int) -> dict[str, Any]:
        identities = {name: {"id": name, "name": name, "nthreads": 1} for name in self.workers}
        return {"workers": {f"tcp://{name}": identity for name, identity in identities.items()}}

    def submit(
        self, function: Callable[..., Any], *arguments: Any, workers: Sequence[str], **more: Any
    ) -> Answer:
        future = asyncio.get_running_loop().create_future()
        self._open.append((function.__name__, future))
        name = workers[0].removeprefix("tcp://")
        if function.__name__ in ("deliver_bundle", "deliver_growth", "leave_run"):
            self.calls.append(f"{function.__name__} {name}")
        if function.__name__ == "run_piece":
            self.began.append(name)
            asyncio.get_running_loop().call_later(
                self.seconds.get(name, 0.02), self._end, future, name, arguments[1]
            )
            if len(self.began) == self.cut_at:
                self.drop_tasks()
        elif function.__name__ != "attend_run":
            future.set_result(FACTS if function.__name__ == "machine_facts" else None)
        return Answer(future)

    def drop_tasks(self, function_name: str = "") -> None:
        """Forget the tasks of a function, or of all."""
        for name, future in self._open:
            if not future.done() and function_name in ("", name):
                future.set_exception(FutureCancelledError("some", "lost"))

    def _end(self, future: "asyncio.Future[Any]", name: str, piece: bytes) -> None:
        if not future.done():
            future.set_result(self.workers[name](Piece.from_bytes(piece)).to_bytes())


def dealt(session: Any, workers: Workers, queued: int | None = None) -> tuple[dict[str, Record], list[str]]:
    remarks: list[str] = []

    async def deal() -> None:
        client: Any = workers
        async with asyncio.timeout(20.0):
            await WorkDispatcher(
                session, AttendingWorkers(client), remarks.append, expected_workers=queued
            ).run()

    run(deal())
    return dict(session.folder.records()), remarks


def errors(records: dict[str, Record]) -> list[str]:
    return [name for name, record in records.items() if record.status is Status.HARNESS_ERROR]


@pytest.mark.parametrize(
    "ending",
    [
        PieceEnding.PROCESS_DIED,
        PieceEnding.HARNESS_FAILED,
        PieceEnding.WORKER_UNFIT,
        PieceEnding.GOLDEN_DIFFERS,
    ],
)
def test_no_experiment_is_blamed_for_a_failing_worker(session: Any, ending: PieceEnding) -> None:
    workers = Workers(odd=sick(ending), alpha=healthy)
    workers.seconds["alpha"] = (
        0.2  # otherwise, it finishes everything before the other has failed often enough
    )
    records, remarks = dealt(session, workers)
    assert (len(records), errors(records), session.problem) == (12, [], "")
    assert [
        remark for remark in remarks if remark.startswith("worker odd at ") and remark.endswith("the reason")
    ]


@pytest.mark.parametrize("ending", [PieceEnding.PROCESS_DIED, PieceEnding.HARNESS_FAILED])
def test_an_experiment_that_fails_everywhere_is_a_harness_error(session: Any, ending: PieceEnding) -> None:
    deadly = list(plan_file.experiment_ids(session.folder.path))[5]
    records, remarks = dealt(session, Workers(alpha=sick(ending, deadly), beta=sick(ending, deadly)))
    assert (len(records), errors(records), session.problem, remarks) == (12, [deadly], "", [])
    assert records[deadly].detail.endswith("twice: the reason")


def test_work_is_submitted_again_after_a_lost_connection(session: Any) -> None:
    """The scheduler forgets all tasks when the command's connection breaks."""
    workers = Workers(alpha=healthy, beta=healthy)
    workers.cut_at = 2
    records, remarks = dealt(session, workers)
    assert (len(records), errors(records), session.problem, remarks) == (12, [], "", [])


def test_workers_stay_for_the_next_session(session: Any) -> None:
    """A worker gets the bundle once; one that has come since, or whose tasks the scheduler has dropped, is
    admitted. A refused one is asked again, because it can be fit then. All are dismissed at the end.
    """
    workers = Workers(alpha=healthy, odd=sick(PieceEnding.GOLDEN_DIFFERS))
    workers.seconds["alpha"] = 0.1  # so that the other gets a piece, too
    client: Any = workers
    pending, calls_by_session = session.pending, []

    async def distribute_all() -> None:
        attending = AttendingWorkers(client)
        for changes in ({}, {"odd": healthy}, {"beta": healthy}, {}):
            workers.workers |= changes
            session.pending = pending
            await WorkDispatcher(session, attending, lambda remark: None, expected_workers=None).run()
            calls_by_session.append(sorted(workers.calls))
            workers.calls.clear()
            if "beta" in changes:
                workers.drop_tasks("attend_run")
        await attending.dismiss()
        calls_by_session.append(sorted(workers.calls))

    run(distribute_all())
    admitted = [
        ["deliver_bundle alpha", "deliver_bundle odd"],
        ["deliver_bundle odd"],
        ["deliver_bundle beta"],
    ]
    readmitted = ["deliver_bundle alpha", "deliver_bundle beta", "deliver_bundle odd"]
    dismissed = ["leave_run alpha", "leave_run beta", "leave_run odd"]
    assert calls_by_session == [[*admitted[0], "leave_run odd"], *admitted[1:], readmitted, dismissed]


def test_a_worker_is_told_what_a_bench_has_needed_since(
    session: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """New golden runs are delivered to the workers that attend; new limits need new processes."""
    monkeypatch.setattr(Bundle, "pack_growth", lambda *arguments: Bundle(b"", ""))
    client: Any = (workers := Workers(alpha=healthy))
    pending, calls_by_session = session.pending, []
    golden_runs, limits = session.folder.golden_runs, session.folder.limits

    async def distribute_all() -> None:
        attending = AttendingWorkers(client)
        for runs, wall_s in (
            ((), 100),
            (golden_runs, 100),
            (golden_runs, 100),
            (golden_runs, 200),
        ):
            vars(session.folder)["golden_runs"] = runs
            monkeypatch.setattr(RunFolder, "limits", replace(limits, wall_s=wall_s))
            session.pending = pending
            await WorkDispatcher(session, attending, lambda remark: None, expected_workers=None).run()
            calls_by_session.append([*workers.calls])
            workers.calls.clear()

    run(distribute_all())
    assert calls_by_session == [
        ["deliver_bundle alpha"],
        ["deliver_growth alpha"],
        [],
        ["leave_run alpha", "deliver_bundle alpha"],
    ]


def test_work_waits_for_a_queued_worker_after_a_refusal(session: Any) -> None:
    workers = Workers(odd=sick(PieceEnding.GOLDEN_DIFFERS))

    async def late() -> None:
        await asyncio.sleep(1.5)
        workers.workers["alpha"] = healthy

    async def deal() -> None:
        client: Any = workers
        async with asyncio.timeout(20.0), asyncio.TaskGroup() as group:
            group.create_task(late())
            dispatcher = WorkDispatcher(
                session, AttendingWorkers(client), lambda remark: None, expected_workers=2
            )
            group.create_task(dispatcher.run())

    run(deal())
    assert (len(session.folder.records()), session.problem) == (12, "")


def test_without_a_queue_a_refused_worker_ends_the_command(session: Any) -> None:
    dealt(session, Workers(odd=sick(PieceEnding.GOLDEN_DIFFERS)))
    assert session.problem == "no worker is left to do the work: the reason"


def test_no_experiment_is_given_up_while_results_are_written(
    session: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Giving up and writing results both append to the same file."""
    inside, most = [0], [0]

    def slow(real: Callable[..., None]) -> Callable[..., None]:
        def call(*arguments: Any) -> None:
            inside[0] += 1
            most[0] = max(most[0], inside[0])
            time.sleep(0.2)
            real(*arguments)
            inside[0] -= 1

        return call

    for name in ("append_result", "append_harness_errors"):
        monkeypatch.setattr(ResultIntake, name, slow(getattr(ResultIntake, name)))
    deadly = next(iter(plan_file.experiment_ids(session.folder.path)))
    work = sick(PieceEnding.PROCESS_DIED, deadly)
    records, _ = dealt(session, Workers(alpha=work, beta=work, gamma=work))
    assert errors(records) == [deadly]
    assert most == [1]
