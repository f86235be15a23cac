"""A bench whose batches a distributor of campaigns deals, as to a cluster."""

from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

import mutator
from mutator.api import benches
from mutator.errors import MutatorError
from mutator.execution import distributed_crew
from mutator.execution.bench_crew import CrewBatch
from mutator.execution.distributed_crew import DistributedCrew
from mutator.execution.session import Session
from mutator.execution.worker import Worker
from mutator.model import Experiment
from mutator.store import plan_file
from mutator.store.preflight_results import golden_digests
from mutator.workspace import Workspace


class InThisProcess:
    """Does the work at once, as a new worker of the session each time. `counts` has the experiments."""

    def __init__(self) -> None:
        self.counts: list[tuple[int, int]] = []

    def run(self, session: Session) -> None:
        self.counts.append((sum(len(work.pending_positions) for work in session.pending), len(session.proof)))
        name = session.unused_worker_name("cluster").removeprefix(session.worker_prefix)
        goldens = golden_digests(session.folder)
        assignment = replace(session.worker_assignment(name), golden_digests=goldens)
        session.written.note_worker_began(assignment.worker_name)
        worker = Worker(session.inputs, assignment)
        run, chunks = session.folder.path, session.folder.head.chunks
        faults = plan_file.load_faults(run)
        for chunk in session.pending:
            experiments = plan_file.load_chunk(run, chunks[chunk.chunk_index], faults)
            list(worker.run_experiments([experiments[at] for at in chunk.pending_positions]))
        planned = {experiment.id: experiment for experiment in plan_file.load_experiments(run)}
        list(worker.prove_experiments([planned[sample.id] for sample in session.proof]))
        worker.close()
        session.written.add_report(worker.file_digests, assignment.worker_name)


@pytest.mark.usefixtures("kept_checks")
def test_a_bench_with_a_distributor_has_the_same_seal(
    toycar: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Batches that wait are dealt together, each with a new worker; records, seal and audit are those of a
    bench with workers of its own."""

    def asked(bench: mutator.Bench) -> list[Experiment]:
        longer = "sensor/distance/longer"
        return [bench.build_experiment(longer, name, 1.0, value=value) for value in (5, 40) for name in "AB"]

    with mutator.open_bench(toycar, tmp_path / "own", campaign="small", reuse=False) as bench:
        records = bench.run(asked(bench))
    distributor = InThisProcess()
    monkeypatch.setattr(benches, "choose_distributor", lambda cluster, insecure: distributor)
    with mutator.open_bench(toycar, tmp_path / "dealt", campaign="small", cluster="anywhere") as bench:
        for experiment in asked(bench)[:2]:
            bench.submit([experiment])
        assert list(bench.results()) == records[:2]
        assert bench.run(asked(bench)) == records
    assert distributor.counts == [(2, 0), (2, 0), (0, 3)]
    own, dealt = (mutator.load_run(tmp_path / name, workspace=toycar) for name in ("own", "dealt"))
    assert dealt.seal == own.seal is not None
    assert dealt.verify().differences == ()


def crew_with(monkeypatch: pytest.MonkeyPatch, **ends: Any) -> tuple[DistributedCrew, SimpleNamespace]:
    """Return a crew whose distributor leaves its session so, without a record, and this session."""
    folder = SimpleNamespace(records=lambda kind: {}, path=Path())
    session = SimpleNamespace(folder=folder, problem="", interrupted=False)
    monkeypatch.setattr(distributed_crew, "chunks_with", lambda folder, ids: tuple(ids))
    monkeypatch.setattr(distributed_crew, "reporting_progress", lambda session: nullcontext())
    distributor = SimpleNamespace(run=lambda session: vars(session).update(ends))
    return DistributedCrew(distributor, 1, lambda: session, lambda record: None), session  # type: ignore[arg-type, return-value]


def batch_of(experiment: Experiment) -> CrewBatch:
    return CrewBatch(runs=[[experiment]], golden_digests={}, scenario_files={})


@pytest.mark.parametrize(
    ("ends", "error", "text"),
    [
        ({"problem": "the scheduler is gone"}, MutatorError, "the scheduler is gone; .*ask again"),
        ({}, MutatorError, "no result of experiment"),
        ({"interrupted": True}, KeyboardInterrupt, None),
    ],
)
def test_whoever_waits_for_a_record_hears_why_there_is_none(
    monkeypatch: pytest.MonkeyPatch,
    experiment: Callable[..., Experiment],
    ends: dict[str, Any],
    error: type[BaseException],
    text: str | None,
) -> None:
    """A problem of the cluster, an interruption, or a lost record; the next call finds no old problem."""
    crew, session = crew_with(monkeypatch, **ends)
    crew.hand_out(batch_of(experiment()))
    with pytest.raises(error, match=text):
        crew.receive()
    assert (session.problem, session.interrupted, session.pending) == ("", False, ())


def test_a_stopped_crew_accepts_no_more(
    monkeypatch: pytest.MonkeyPatch, experiment: Callable[..., Experiment]
) -> None:
    crew, _ = crew_with(monkeypatch)
    crew.stop()
    with pytest.raises(MutatorError, match="the bench was closed"):
        crew.hand_out(batch_of(experiment()))


def test_a_distributor_that_can_stay_is_open_until_the_crew_ends(
    monkeypatch: pytest.MonkeyPatch, experiment: Callable[..., Experiment]
) -> None:
    """It is told to stay, and is closed with the crew, and when the crew is killed after a problem; new
    limits do not close it."""
    calls: list[str] = []
    names = ("stay_open", "run", "close")
    acts = {name: lambda *arguments, name=name: calls.append(name) for name in names}
    session = crew_with(monkeypatch)[1]
    crew = DistributedCrew(SimpleNamespace(**acts), 1, lambda: session, lambda record: None)  # type: ignore[arg-type, return-value]
    crew.hand_out(batch_of(experiment()))
    with pytest.raises(MutatorError, match="no result"):
        crew.receive()
    crew.use_new_limits()
    assert calls == ["stay_open", "run"]
    crew.kill()
    crew.close()
    assert calls == ["stay_open", "run", "close", "close"]
