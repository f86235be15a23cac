"""Decide which worker runs which piece of work next. The queue uses no network and starts no process.

Pieces are cut on demand. Their sizes depend on measured times, so that all workers finish at about the same
time. If possible, a worker gets experiments whose golden run it already has. Near the end, idle workers
repeat late pieces.
"""

import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice

from mutator.campaigns.chunks import PendingChunk
from mutator.execution.cluster.piece_messages import Piece, PieceKind
from mutator.execution.cluster.work_by_golden import (
    GoldenRunGroup,
    PlanLinesOfRun,
    fault_lines_of,
    golden_key_of,
    group_by_golden,
)
from mutator.preflight.equivalence_check import SampledExperiment
from mutator.store import plan_file
from mutator.store.plan_lines import id_on_line
from mutator.store.run_folder import RunFolder

MIN_PIECE_S, MOST_PIECE_S = 0.5, 8.0  # shortest and longest intended duration of a piece
_REMAINING_PIECES_PER_SLOT = 4  # a piece is the remaining work divided by the number of workers and by this
_RUNS_IN_FIRST_PIECE = 4  # runs in a piece before the first measurement
_ASSUMED_RUN_S = 0.5  # duration of a run before the first measurement
_LATE_FACTOR = 3.0  # a piece that takes this many times as long as expected is repeated by another worker
_MIN_LATE_S = 5.0  # no piece is repeated before this many seconds
_DEATHS_BEFORE_SPLIT = 2  # a piece that has killed this many workers is split
# a worker idle for this long (or longer, if runs are slow) proves its own runs
_MIN_IDLE_TO_PROVE_ITSELF_S = 20.0


@dataclass
class _PieceInProgress:
    """A piece in progress."""

    piece: Piece
    worker: str
    start_s: float
    expected_s: float
    repeating_workers: set[str] = field(default_factory=set)  # workers that repeat the piece

    def drop_worker(self, worker: str) -> bool:
        """Take a worker off the piece; return whether another worker is still running it."""
        if worker not in self.repeating_workers and self.repeating_workers:
            self.worker = self.repeating_workers.pop()
            return True
        was_repeating = worker in self.repeating_workers
        self.repeating_workers.discard(worker)
        return was_repeating


class PieceQueue:
    """Distributes the pending work of a run folder. `now` returns the time in seconds."""

    def __init__(
        self,
        folder: RunFolder,
        pending: Sequence[PendingChunk],
        proof: Sequence[SampledExperiment],
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        self._now, self._folder = now, folder
        self._last_number = 0
        self._fault_lines = plan_file.fault_line_by_id(folder.path)
        self._groups_by_golden = group_by_golden(folder, pending, self._fault_lines)
        self._sampled_ids = {sample.id for sample in proof}
        self._proof_pieces = [
            self._build_proof_piece(line)
            for line in plan_file.selected_experiment_lines(folder.path, self._sampled_ids)
        ]
        self._pieces_in_progress: dict[int, _PieceInProgress] = {}
        self._worker_by_sampled: dict[str, str] = {}  # the worker that ran each experiment of the sample
        self._golden_by_worker: dict[str, str] = {}  # the golden run that each worker has
        self._slots_by_worker: dict[str, int] = {}  # how many pieces each present worker runs at once
        self._idle_since_by_worker: dict[str, float] = {}
        self._seconds_by_kind = dict.fromkeys(PieceKind, 0.0)
        self._finished_runs_by_kind: Counter[PieceKind] = Counter()

    def add_worker(self, worker: str, slots: int) -> None:
        self._slots_by_worker[worker] = slots

    def forget_worker(self, worker: str) -> None:
        for values_by_worker in (self._slots_by_worker, self._golden_by_worker, self._idle_since_by_worker):
            values_by_worker.pop(worker, None)

    @property
    def is_empty(self) -> bool:
        return not (self._pieces_in_progress or self._proof_pieces or self._waiting_count)

    @property
    def has_run_all(self) -> bool:
        outstanding = any(out.piece.kind is PieceKind.RUN for out in self._pieces_in_progress.values())
        return not (self._waiting_count or outstanding)

    def drop_proof_pieces(self) -> None:
        self._proof_pieces.clear()

    def take_piece(self, worker: str, *, ahead: bool = False) -> Piece | None:
        """Return the next piece for a worker, or None.

        With `ahead`, the piece waits at the worker while another piece runs there; near the end of the work,
        the result is then None.
        """
        # near the end, a piece that waits here is one that an idle worker lacks
        if (
            ahead
            and self._waiting_count * self._mean_run_s(PieceKind.RUN) < 2 * self._slot_count * MIN_PIECE_S
        ):
            return None
        piece = self._next_piece_to_run(worker)
        if piece is None and not ahead:
            piece = self._next_piece_to_prove(worker) or self._late_piece_to_repeat(worker)
            self._idle_since_by_worker.setdefault(worker, self._now())
        if piece is None:
            return None
        self._idle_since_by_worker.pop(worker, None)
        if piece.number in self._pieces_in_progress:
            self._pieces_in_progress[piece.number].repeating_workers.add(worker)
            return piece
        expected_s = piece.run_count * self._mean_run_s(piece.kind)
        self._pieces_in_progress[piece.number] = _PieceInProgress(piece, worker, self._now(), expected_s)
        return piece

    def finish_piece(self, piece: Piece, worker: str, seconds: float) -> bool:
        """Note that a piece is done; return False if another worker has already done it."""
        if self._pieces_in_progress.pop(piece.number, None) is None:
            return False
        self._seconds_by_kind[piece.kind] += seconds
        self._finished_runs_by_kind[piece.kind] += piece.run_count
        if piece.kind is PieceKind.RUN:
            self._worker_by_sampled.update(
                (name, worker) for name in piece.plan_lines if name in self._sampled_ids
            )
        return True

    def give_back_piece(self, piece: Piece, worker: str) -> None:
        """Put back a piece that a worker could not finish for a reason unrelated to the piece."""
        if (out := self._pieces_in_progress.get(piece.number)) is None:
            return
        if not out.drop_worker(worker):
            del self._pieces_in_progress[piece.number]
            self._put_back(out.piece)

    def requeue_after_death(self, piece: Piece, worker: str, running_experiment: str = "") -> Piece | None:
        """Note that a worker or its process died during a piece, perhaps in `running_experiment`.

        The piece is put back for other workers, with `running_experiment` in a separate piece. After two
        deaths, a piece is split; if it has only one experiment, it is returned, and the caller must give it
        up.
        """
        if (out := self._pieces_in_progress.get(piece.number)) is None:
            return None
        out.piece = piece = replace(out.piece, killed_workers=(*out.piece.killed_workers, worker))
        if out.drop_worker(worker):
            return None
        del self._pieces_in_progress[piece.number]
        lines, twice = piece.plan_lines, len(piece.killed_workers) >= _DEATHS_BEFORE_SPLIT
        if len(lines) == 1 and twice:
            return piece
        if running_experiment in lines and len(lines) > 1:
            rest = {name: line for name, line in lines.items() if name != running_experiment}
            self._put_back(
                self._build_part(piece, {running_experiment: lines[running_experiment]}, piece.killed_workers)
            )
            self._put_back(self._build_part(piece, rest, ()))
        elif twice:
            names = list(lines)
            for half in (names[: len(names) // 2], names[len(names) // 2 :]):
                self._put_back(self._build_part(piece, {name: lines[name] for name in half}, (worker,)))
        else:
            self._put_back(piece)
        return None

    @property
    def _slot_count(self) -> int:
        return max(1, sum(self._slots_by_worker.values()))

    @property
    def _waiting_count(self) -> int:
        return sum(group.waiting_experiment_count for group in self._groups_by_golden.values())

    def _mean_run_s(self, kind: PieceKind) -> float:
        return (
            self._seconds_by_kind[kind] / self._finished_runs_by_kind[kind]
            if self._finished_runs_by_kind[kind]
            else _ASSUMED_RUN_S
        )

    def _next_piece_to_run(self, worker: str) -> Piece | None:
        group = self._choose_group(worker)
        if group is None:
            return None
        self._golden_by_worker[worker] = group.golden_key
        for place, piece in enumerate(group.returned_pieces):
            if self._can_run_piece(worker, piece):
                del group.returned_pieces[place]
                return piece
        runs = list(islice(group.uncut_runs, self._runs_in_next_piece()))
        lines = {name: line for run in runs for name, line in run.items()}
        group.uncut_experiment_count -= len(lines)
        return self._build_piece(PieceKind.RUN, group.golden_key, lines, run_count=len(runs))

    def _runs_in_next_piece(self) -> int:
        if not self._finished_runs_by_kind[PieceKind.RUN]:
            return _RUNS_IN_FIRST_PIECE
        mean_s = self._mean_run_s(PieceKind.RUN)
        share_s = self._waiting_count * mean_s / (_REMAINING_PIECES_PER_SLOT * self._slot_count)
        return (
            max(1, round(min(MOST_PIECE_S, max(MIN_PIECE_S, share_s)) / mean_s))
            if mean_s
            else _RUNS_IN_FIRST_PIECE
        )

    def _choose_group(self, worker: str) -> GoldenRunGroup | None:
        """Return the worker's group or, if that has no work, the group with the most work per worker."""
        current_group = self._groups_by_golden.get(self._golden_by_worker.get(worker, ""))
        if current_group is not None and self._has_work_for(current_group, worker):
            return current_group
        workers_by_golden = Counter(self._golden_by_worker.values())
        waiting = [group for group in self._groups_by_golden.values() if self._has_work_for(group, worker)]
        return max(
            waiting,
            key=lambda group: group.waiting_experiment_count / (1 + workers_by_golden[group.golden_key]),
            default=None,
        )

    def _has_work_for(self, group: GoldenRunGroup, worker: str) -> bool:
        return bool(group.uncut_experiment_count) or any(
            self._can_run_piece(worker, piece) for piece in group.returned_pieces
        )

    def _can_run_piece(self, worker: str, piece: Piece) -> bool:
        """Return whether the piece has not killed the worker, or has killed every worker present."""
        return worker not in piece.killed_workers or self._slots_by_worker.keys() <= set(piece.killed_workers)

    def _next_piece_to_prove(self, worker: str) -> Piece | None:
        """Return a piece of the proof with an experiment that another worker or an earlier session ran.

        A worker proves its own experiments only if it is the only worker, or after a long idle time.
        """
        running = {
            name
            for out in self._pieces_in_progress.values()
            for name in out.piece.plan_lines
            if name in self._sampled_ids
        }
        idle_s = self._now() - self._idle_since_by_worker.get(worker, self._now())
        takes_own = len(self._slots_by_worker) <= 1 or idle_s > max(
            _MIN_IDLE_TO_PROVE_ITSELF_S, _LATE_FACTOR * self._mean_run_s(PieceKind.RUN)
        )
        for place, piece in enumerate(self._proof_pieces):
            name = next(iter(piece.plan_lines))
            other = not (name in running or self._worker_by_sampled.get(name) == worker)
            if (takes_own or other) and self._can_run_piece(worker, piece):
                return self._proof_pieces.pop(place)
        return None

    def _late_piece_to_repeat(self, worker: str) -> Piece | None:
        now = self._now()
        late = [
            (now - out.start_s - out.expected_s, out.piece)
            for out in self._pieces_in_progress.values()
            if worker != out.worker
            and not out.repeating_workers
            and self._can_run_piece(worker, out.piece)
            and now - out.start_s > max(_LATE_FACTOR * out.expected_s, _MIN_LATE_S)
        ]
        return max(late, key=lambda delay_and_piece: delay_and_piece[0])[1] if late else None

    def _build_piece(
        self,
        kind: PieceKind,
        golden: str,
        lines: PlanLinesOfRun,
        *,
        run_count: int = 1,
        killed_workers: tuple[str, ...] = (),
    ) -> Piece:
        self._last_number += 1
        return Piece(
            number=self._last_number,
            kind=kind,
            golden_key=golden,
            plan_lines=lines,
            fault_lines=fault_lines_of(lines, self._fault_lines),
            run_count=run_count,
            killed_workers=killed_workers,
        )

    def _build_proof_piece(self, line: bytes) -> Piece:
        lines = {id_on_line(line): line}
        return self._build_piece(PieceKind.PROVE, golden_key_of(self._folder, line, self._fault_lines), lines)

    def _build_part(self, piece: Piece, lines: PlanLinesOfRun, killed_workers: tuple[str, ...]) -> Piece:
        return self._build_piece(
            piece.kind, piece.golden_key, lines, run_count=len(lines), killed_workers=killed_workers
        )

    def _put_back(self, piece: Piece) -> None:
        if piece.kind is PieceKind.PROVE:
            self._proof_pieces.append(piece)
        else:
            self._groups_by_golden[piece.golden_key].returned_pieces.append(piece)
