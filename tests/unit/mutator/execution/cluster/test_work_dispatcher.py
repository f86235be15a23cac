"""The distribution of work to workers that fail in various ways."""

import asyncio
import json
import threading
import time
import warnings
from collections.abc import Callable, Generator, Sequence
from contextlib import asynccontextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from distributed.client import FutureCancelledError

from mutator.campaigns.chunks import pending_chunks_of
from mutator.campaigns.plan import build_plan
from mutator.campaigns.plan_freezing import freeze_plan
from mutator.campaigns.run_provenance import append_session_environment
from mutator.errors import MutatorWarning
from mutator.execution.cluster import cluster_distributor
from mutator.execution.cluster.bundle import Bundle
from mutator.execution.cluster.cluster_distributor import ClusterDistributor
from mutator.execution.cluster.piece_messages import Piece, PieceEnding, PieceResult
from mutator.execution.cluster.result_intake import ResultIntake
from mutator.execution.cluster.work_dispatcher import WorkDispatcher
from mutator.execution.cluster.worker_roster import WorkerRoster
from mutator.execution.written_files import WrittenFiles
from mutator.model import Record, Status
from mutator.store import plan_file
from mutator.store.run_folder import RunFolder
from mutator.store.session_environments import SessionEnvironment
from mutator.workspace import Workspace

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
        return self.future.__await__()

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
        self._open: list[asyncio.Future[Any]] = []

    async def identity(self, n_workers: int) -> dict[str, Any]:
        told = {name: {"id": name, "name": name, "nthreads": 1} for name in self.workers}
        return {"workers": {f"tcp://{name}": one for name, one in told.items()}}

    def submit(
        self, function: Callable[..., Any], *given: Any, workers: Sequence[str], **more: Any
    ) -> Answer:
        future = asyncio.get_running_loop().create_future()
        self._open.append(future)
        if function.__name__ == "run_piece":
            name = workers[0].removeprefix("tcp://")
            self.began.append(name)
            asyncio.get_running_loop().call_later(
                self.seconds.get(name, 0.02), self._end, future, name, given[1]
            )
            if len(self.began) == self.cut_at:
                for one in self._open:
                    if not one.done():
                        one.set_exception(FutureCancelledError("some", "lost"))
        elif function.__name__ != "attend_run":
            future.set_result(FACTS if function.__name__ == "machine_facts" else None)
        return Answer(future)

    def _end(self, future: "asyncio.Future[Any]", name: str, piece: bytes) -> None:
        if not future.done():
            future.set_result(self.workers[name](Piece.from_bytes(piece)).to_bytes())


@pytest.fixture
def folder(toycar: Workspace, tmp_path: Path) -> RunFolder:
    return freeze_plan(build_plan(toycar, "small"), tmp_path / "run", toycar)


@pytest.fixture
def session(toycar: Workspace, folder: RunFolder, monkeypatch: pytest.MonkeyPatch) -> Any:
    """A session in which every experiment is pending, and the versions of workers are not checked."""
    monkeypatch.setattr(Bundle, "pack_for_run", lambda *given: Bundle(b"", ""))
    monkeypatch.setattr(WorkerRoster, "reason_to_refuse", lambda *given: "")
    folder = append_session_environment(folder, SessionEnvironment(python="", packages={}, platform=""))
    return SimpleNamespace(
        workspace=toycar,
        folder=folder,
        manifest=toycar.manifest("toycar"),
        pending=pending_chunks_of(folder, {}),
        proof=(),
        engine="fork",
        accept_versions=True,
        unused_worker_name=lambda name: f"0001-{name}",
        written=WrittenFiles(),
        note_machine=lambda machine: None,
        problem="",
        interrupted=False,
        workers_note="",
    )


def dealt(session: Any, workers: Workers, queued: int | None = None) -> tuple[dict[str, Record], list[str]]:
    remarks: list[str] = []

    async def deal() -> None:
        client: Any = workers
        async with asyncio.timeout(20.0):
            await WorkDispatcher(session, client, remarks.append, expected_workers=queued).run()

    run(deal())
    return dict(session.folder.records()), remarks


def errors(records: dict[str, Record]) -> list[str]:
    return [name for name, one in records.items() if one.status is Status.HARNESS_ERROR]


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
    assert [one for one in remarks if one.startswith("worker odd at ") and one.endswith("the reason")]


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


def test_work_waits_for_a_queued_worker_after_a_refusal(session: Any) -> None:
    workers = Workers(odd=sick(PieceEnding.GOLDEN_DIFFERS))

    async def late() -> None:
        await asyncio.sleep(1.5)
        workers.workers["alpha"] = healthy

    async def deal() -> None:
        client: Any = workers
        async with asyncio.timeout(20.0), asyncio.TaskGroup() as group:
            group.create_task(late())
            group.create_task(WorkDispatcher(session, client, lambda remark: None, expected_workers=2).run())

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
        def call(*given: Any) -> None:
            inside[0] += 1
            most[0] = max(most[0], inside[0])
            time.sleep(0.2)
            real(*given)
            inside[0] -= 1

        return call

    for name in ("append_result", "append_harness_errors"):
        monkeypatch.setattr(ResultIntake, name, slow(getattr(ResultIntake, name)))
    deadly = next(iter(plan_file.experiment_ids(session.folder.path)))
    work = sick(PieceEnding.PROCESS_DIED, deadly)
    records, _ = dealt(session, Workers(alpha=work, beta=work, gamma=work))
    assert errors(records) == [deadly]
    assert most == [1]


def test_an_error_in_a_remark_ends_the_work(session: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    class Place:
        @asynccontextmanager
        async def open(self, *, insecure: bool):  # type: ignore[no-untyped-def]
            yield None

    class Remarking:
        def __init__(self, session: Any, client: Any, remark: Callable[[str], None], **more: Any) -> None:
            self._remark = remark

        async def run(self) -> None:
            self._remark("something")
            await asyncio.sleep(60.0)

    monkeypatch.setattr(cluster_distributor, "WorkDispatcher", Remarking)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(MutatorWarning, match="something"):
            ClusterDistributor(Place()).run(session)
    assert not [one for one in threading.enumerate() if one.name == "cluster" and one.is_alive()]
