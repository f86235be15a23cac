"""How the board distributes pieces of work to workers."""

import random
from collections import Counter
from itertools import pairwise
from pathlib import Path

import pytest

from mutator.campaigns.chunks import pending_chunks_of
from mutator.campaigns.plan import build_plan
from mutator.campaigns.plan_freezing import freeze_plan
from mutator.execution.cluster.piece_messages import Piece, PieceKind
from mutator.execution.cluster.piece_queue import PieceQueue
from mutator.preflight.equivalence_check import SampledExperiment
from mutator.store import plan_file
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace

CLONE = Path(__file__).parents[5]


class Clock:
    """A clock whose time is set by the tests."""

    now = 0.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> RunFolder:
    """A frozen plan in which some experiments share a run."""
    shipped = Workspace.find(root=CLONE)
    return freeze_plan(build_plan(shipped, "paper_smoke"), tmp_path_factory.mktemp("board") / "run", shipped)


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def ids(folder: RunFolder) -> list[str]:
    return list(plan_file.experiment_ids(folder.path))


def board(folder: RunFolder, clock: Clock, proof: tuple[str, ...] = ()) -> PieceQueue:
    """Return a board for two workers, with the whole plan and a proof that reruns the experiments in
    `proof`."""
    samples = [SampledExperiment(number, name) for number, name in enumerate(proof)]
    made = PieceQueue(folder, pending_chunks_of(folder, {}), samples, now=clock)
    for name in ("alpha", "beta"):
        made.add_worker(name, 1)
    return made


def taken(board: PieceQueue, worker: str) -> Piece:
    piece = board.take_piece(worker)
    assert piece is not None
    return piece


def drained(board: PieceQueue, workers: tuple[str, ...] = ("alpha", "beta")) -> list[tuple[str, Piece]]:
    """Let the workers take pieces until none is left. Return each worker with its piece, in order."""
    done = []
    while not board.is_empty:
        for worker in workers:
            if (piece := board.take_piece(worker)) is not None:
                done.append((worker, piece))
                assert board.finish_piece(piece, worker, 0.4 * piece.run_count)
    return done


def test_each_experiment_is_run_exactly_once(folder: RunFolder, clock: Clock, ids: list[str]) -> None:
    done = [piece for _, piece in drained(board(folder, clock))]
    assert sorted(name for piece in done for name in piece.plan_lines) == sorted(ids)
    for piece in done:
        experiments = Piece.from_bytes(piece.to_bytes()).parse_experiments()
        assert [experiment.id for experiment in experiments] == list(piece.plan_lines)
        assert {folder.golden_run_of(experiment).key for experiment in experiments} >= {piece.golden_key}


def test_the_proof_reruns_an_experiment_on_another_worker(
    folder: RunFolder, clock: Clock, ids: list[str]
) -> None:
    done = drained(board(folder, clock, tuple(ids[::7])))
    ran = {name: worker for worker, piece in done if piece.kind is PieceKind.RUN for name in piece.plan_lines}
    proved = {
        name: worker for worker, piece in done if piece.kind is PieceKind.PROVE for name in piece.plan_lines
    }
    assert sorted(proved) == sorted(ids[::7])
    assert all(ran[name] != worker for name, worker in proved.items())


def test_a_single_worker_proves_its_own_experiments(folder: RunFolder, clock: Clock, ids: list[str]) -> None:
    alone = board(folder, clock, tuple(ids[:2]))
    alone.forget_worker("beta")
    done = drained(alone, ("alpha",))
    assert [piece.kind for _, piece in done][-2:] == [PieceKind.PROVE, PieceKind.PROVE]


def test_a_worker_prefers_experiments_with_its_current_golden_run(folder: RunFolder, clock: Clock) -> None:
    done = drained(board(folder, clock))
    for worker in ("alpha", "beta"):
        keys = [piece.golden_key for name, piece in done if name == worker]
        changes = sum(one != other for one, other in pairwise(keys))
        assert changes <= len(folder.golden_runs)


def test_the_last_pieces_are_shorter(folder: RunFolder, clock: Clock) -> None:
    """Here, a run takes longer than the shortest piece should take, so the last pieces have one run each."""
    there = board(folder, clock)
    first = taken(there, "alpha")
    there.finish_piece(first, "alpha", 2.0 * first.run_count)
    sizes = [piece.run_count for _, piece in drained(there)]
    assert max(sizes[:4]) > 1
    assert sizes[-1] == 1


def test_a_late_piece_is_repeated_but_counted_once(folder: RunFolder, clock: Clock) -> None:
    there = board(folder, clock)
    frozen = taken(there, "alpha")
    drained_by_beta = 0
    while (piece := there.take_piece("beta")) is not None:
        there.finish_piece(piece, "beta", 0.1)
        drained_by_beta += 1
    assert drained_by_beta and not there.is_empty
    clock.now += 60.0
    again = taken(there, "beta")
    assert again == frozen
    assert there.finish_piece(again, "beta", 0.1)
    assert not there.finish_piece(frozen, "alpha", 60.0)
    assert there.is_empty


def test_only_an_experiment_that_kills_workers_is_given_up(
    folder: RunFolder, clock: Clock, ids: list[str]
) -> None:
    there, deadly, done = board(folder, clock), ids[17], Counter[str]()
    given_up: list[str] = []
    while not there.is_empty:
        for worker in ("alpha", "beta"):
            if (piece := there.take_piece(worker)) is None:
                continue
            if deadly not in piece.plan_lines:
                there.finish_piece(piece, worker, 0.1)
                done.update(piece.experiment_ids)
            elif (found := there.requeue_after_death(piece, worker)) is not None:
                given_up += found.plan_lines
    assert given_up == [deadly]
    assert sorted([*done.elements(), deadly]) == sorted(ids)


def test_an_experiment_is_given_up_after_it_kills_two_workers(
    folder: RunFolder, clock: Clock, ids: list[str]
) -> None:
    there = board(folder, clock)
    piece = taken(there, "alpha")
    deadly = piece.experiment_ids[-1]
    assert there.requeue_after_death(piece, "alpha", deadly) is None
    apart = next(one for one in iter(lambda: taken(there, "beta"), None) if deadly in one.plan_lines)
    assert apart.experiment_ids == (deadly,)
    assert there.requeue_after_death(apart, "beta", deadly) is not None


def test_only_the_last_worker_retries_a_piece_that_killed_it(folder: RunFolder, clock: Clock) -> None:
    there = board(folder, clock)
    deadly = taken(there, "alpha")
    there.requeue_after_death(deadly, "alpha")
    while (piece := there.take_piece("alpha")) is not None:
        assert piece.number != deadly.number
        there.finish_piece(piece, "alpha", 0.1)
    assert taken(there, "beta").number == deadly.number
    clock.now += 60.0
    assert there.take_piece("alpha") is None
    there.give_back_piece(deadly, "beta")
    there.forget_worker("beta")
    assert taken(there, "alpha").number == deadly.number


def test_a_worker_that_repeats_a_piece_continues_when_another_dies(folder: RunFolder, clock: Clock) -> None:
    for first in ("alpha", "beta"):
        there = board(folder, clock)
        late = taken(there, "alpha")
        while (piece := there.take_piece("beta")) is not None:
            there.finish_piece(piece, "beta", 0.1)
        clock.now += 60.0
        assert taken(there, "beta") == late
        assert there.requeue_after_death(late, first) is None
        assert there.take_piece(first) is None
        assert there.finish_piece(late, "beta" if first == "alpha" else "alpha", 0.1)
        assert there.is_empty


def test_an_idle_worker_leaves_the_proof_to_a_busy_worker(folder: RunFolder, clock: Clock) -> None:
    """The busy worker's piece is not late yet."""
    there = board(folder, clock, taken(board(folder, clock), "alpha").experiment_ids[:1])
    first = taken(there, "alpha")
    there.finish_piece(first, "alpha", 60.0 * first.run_count)
    last = taken(there, "beta")
    while (piece := there.take_piece("alpha")) is not None:
        there.finish_piece(piece, "alpha", 60.0 * piece.run_count)
    clock.now += 50.0
    assert there.take_piece("alpha") is None
    there.finish_piece(last, "beta", 60.0 * last.run_count)
    assert taken(there, "beta").kind is PieceKind.PROVE


def test_each_experiment_is_counted_once_for_any_order_of_events(
    folder: RunFolder, clock: Clock, ids: list[str]
) -> None:
    draw, there, done = random.Random(5), board(folder, clock), Counter[str]()
    out: list[tuple[str, Piece]] = []
    while not there.is_empty:
        clock.now += draw.uniform(0.0, 8.0)
        worker = draw.choice(("alpha", "beta"))
        if (piece := there.take_piece(worker)) is not None:
            out.append((worker, piece))
        if not out:
            continue
        who, piece = out.pop(draw.randrange(len(out)))
        fate = draw.random()
        if fate < 0.2:
            there.give_back_piece(piece, who)
        elif fate < 0.25 and not piece.killed_workers:
            there.requeue_after_death(piece, who)
        elif there.finish_piece(piece, who, 0.3):
            done.update(piece.experiment_ids)
    assert done == Counter(ids)
