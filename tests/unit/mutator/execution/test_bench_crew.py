"""How experiments are dealt to the workers of a bench."""

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

from mutator.execution.bench_crew import (
    BenchCrew,
    CrewBatch,
    _assignment,
    _Board,
    _golden_key_of,
    _Piece,
)
from mutator.execution.pieces import cut_into_pieces
from mutator.model import Experiment


def runs_in(experiment: Callable[..., Experiment], *scenarios: str) -> list[list[Experiment]]:
    return [[experiment(scenario=name)] for name in scenarios]


def pieces_in(experiment: Callable[..., Experiment], *scenarios: str) -> list[_Piece]:
    runs = runs_in(experiment, *scenarios)
    batch = CrewBatch(runs=runs, golden_digests={"A@1": "d"}, scenario_files={"A": Path("A.yaml")})
    return [_Piece(piece, batch) for piece in cut_into_pieces(runs, _golden_key_of, 2)]


def worker() -> Any:
    return cast(Any, SimpleNamespace(golden_key=(), sent_goldens=set(), sent_scenarios=set()))


def test_a_worker_is_told_only_what_is_new(experiment: Callable[..., Experiment]) -> None:
    """Digests of golden runs and files of scenarios are sent to each worker once."""
    who, [piece] = worker(), pieces_in(experiment, "A")
    sent = [_assignment(who, piece) for _ in range(2)]
    assert (sent[0].golden_digests, sent[0].scenario_files) == ({"A@1": "d"}, {"A": Path("A.yaml")})
    assert not sent[1].golden_digests and not sent[1].scenario_files
    assert sent[1].experiments == tuple(piece.runs[0])


def test_whoever_waits_for_a_worker_hears_of_every_failure(experiment: Callable[..., Experiment]) -> None:
    """An error that nobody expected, here of what is sent to the worker, ends the work like any other."""
    unsendable = SimpleNamespace(assignment=SimpleNamespace(worker_name="w1"), value=lambda: None)
    crew = BenchCrew(1, lambda number: cast(Any, unsendable), lambda name, written: None)
    crew.hand_out(CrewBatch(runs=runs_in(experiment, "A"), golden_digests={}, scenario_files={}))
    assert "worker w1 failed" in str(crew._board.arrived.get(timeout=60))
    crew.close()


def test_work_beyond_the_idle_workers_needs_new_ones(experiment: Callable[..., Experiment]) -> None:
    """A worker that is busy takes nothing that is added, so a second small batch gets a second worker."""
    board = _Board(lambda record: None)
    batch = CrewBatch(runs=runs_in(experiment, "A"), golden_digests={}, scenario_files={})
    board._idle_workers.append(worker())
    assert board.add(batch, 2) == 0
    board._idle_workers.clear()
    board._waiting_batches.clear()  # the worker has taken the piece
    assert board.add(batch, 2) == 1
