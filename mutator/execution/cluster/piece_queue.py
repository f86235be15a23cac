"""Decide which worker runs which piece of work next. The board uses no network and starts no process.

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
from mutator.execution.cluster.pieces import Kind, Piece
from mutator.execution.cluster.work_by_golden import Group, Run, faults_of, golden_of, groups_of
from mutator.preflight.equivalence_check import SampledExperiment
from mutator.store import plan_file
from mutator.store.plan_lines import id_on_line
from mutator.store.run_folder import RunFolder

LEAST_S, MOST_S = 0.5, 8.0  # shortest and longest intended duration of a piece
_SHARE = 4  # a piece is the remaining work divided by the number of workers and by this
_FIRST = 4  # runs in a piece before the first measurement
_GUESS_S = 0.5  # duration of a run before the first measurement
_LATE = 3.0  # a piece that takes this many times as long as expected is repeated by another worker
_LATE_S = 5.0  # no piece is repeated before this many seconds
_DEATHS = 2  # a piece that has killed this many workers is split
_PROOF_S = 20.0  # a worker idle for this long (or longer, if runs are slow) proves its own runs


@dataclass
class _Out:
    """A piece in progress."""

    piece: Piece
    worker: str
    since: float
    expected_s: float
    others: set[str] = field(default_factory=set)  # workers that repeat the piece

    def goes_on_without(self, worker: str) -> bool:
        """Take a worker off the piece; return whether another worker is still running it."""
        if worker not in self.others and self.others:
            self.worker = self.others.pop()
            return True
        known = worker in self.others
        self.others.discard(worker)
        return known


class Board:
    """Distributes the pending work of a run folder. `now` returns the time in seconds."""

    def __init__(
        self,
        folder: RunFolder,
        pending: Sequence[PendingChunk],
        proof: Sequence[SampledExperiment],
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        self._now, self._folder = now, folder
        self._number = 0
        self._faults = plan_file.fault_line_by_id(folder.path)
        self._groups = groups_of(folder, pending, self._faults)
        self._sampled = {sample.id for sample in proof}
        self._proof = [
            self._proof_piece(line) for line in plan_file.experiment_lines(folder.path, self._sampled)
        ]
        self._out: dict[int, _Out] = {}
        self._maker: dict[str, str] = {}  # the worker that ran each experiment of the sample
        self._at: dict[str, str] = {}  # the golden run that each worker has
        self._slots: dict[str, int] = {}  # how many pieces each present worker runs at once
        self._idle_since: dict[str, float] = {}
        self._seconds = dict.fromkeys(Kind, 0.0)
        self._done: Counter[Kind] = Counter()

    def join(self, worker: str, slots: int) -> None:
        self._slots[worker] = slots

    def leave(self, worker: str) -> None:
        for known in (self._slots, self._at, self._idle_since):
            known.pop(worker, None)

    @property
    def is_empty(self) -> bool:
        return not (self._out or self._proof or self._waiting)

    @property
    def ran_all(self) -> bool:
        outstanding = any(out.piece.kind is Kind.RUN for out in self._out.values())
        return not (self._waiting or outstanding)

    def drop_proof(self) -> None:
        self._proof.clear()

    def take(self, worker: str, *, ahead: bool = False) -> Piece | None:
        """Return the next piece for a worker, or None.

        With `ahead`, the piece waits at the worker while another piece runs there; near the end of the work,
        the result is then None.
        """
        if ahead and self._waiting * self._mean_s(Kind.RUN) < 2 * self._at_once * LEAST_S:
            return None
        piece = self._cut(worker)
        if piece is None and not ahead:
            piece = self._proof_for(worker) or self._late_for(worker)
            self._idle_since.setdefault(worker, self._now())
        if piece is None:
            return None
        self._idle_since.pop(worker, None)
        if piece.number in self._out:
            self._out[piece.number].others.add(worker)
            return piece
        expected_s = piece.runs * self._mean_s(piece.kind)
        self._out[piece.number] = _Out(piece, worker, self._now(), expected_s)
        return piece

    def done(self, piece: Piece, worker: str, seconds: float) -> bool:
        """Note that a piece is done; return False if another worker has already done it."""
        if self._out.pop(piece.number, None) is None:
            return False
        self._seconds[piece.kind] += seconds
        self._done[piece.kind] += piece.runs
        if piece.kind is Kind.RUN:
            self._maker.update((name, worker) for name in piece.lines if name in self._sampled)
        return True

    def give_back(self, piece: Piece, worker: str) -> None:
        """Put back a piece that a worker could not finish for a reason unrelated to the piece."""
        if (out := self._out.get(piece.number)) is None:
            return
        if not out.goes_on_without(worker):
            del self._out[piece.number]
            self._again(out.piece)

    def died(self, piece: Piece, worker: str, at: str = "") -> Piece | None:
        """Note that a worker or its process died during a piece, perhaps in the experiment `at`.

        The piece is put back for other workers, with `at` in a separate piece. After two deaths, a piece is
        split; if it has only one experiment, it is returned, and the caller must give it up.
        """
        if (out := self._out.get(piece.number)) is None:
            return None
        out.piece = piece = replace(out.piece, died_at=(*out.piece.died_at, worker))
        if out.goes_on_without(worker):
            return None
        del self._out[piece.number]
        lines, twice = piece.lines, len(piece.died_at) >= _DEATHS
        if len(lines) == 1 and twice:
            return piece
        if at in lines and len(lines) > 1:
            rest = {name: line for name, line in lines.items() if name != at}
            self._again(self._part(piece, {at: lines[at]}, piece.died_at))
            self._again(self._part(piece, rest, ()))
        elif twice:
            names = list(lines)
            for half in (names[: len(names) // 2], names[len(names) // 2 :]):
                self._again(self._part(piece, {name: lines[name] for name in half}, (worker,)))
        else:
            self._again(piece)
        return None

    @property
    def _at_once(self) -> int:
        return max(1, sum(self._slots.values()))

    @property
    def _waiting(self) -> int:
        return sum(group.waiting for group in self._groups.values())

    def _mean_s(self, kind: Kind) -> float:
        return self._seconds[kind] / self._done[kind] if self._done[kind] else _GUESS_S

    def _cut(self, worker: str) -> Piece | None:
        group = self._group_for(worker)
        if group is None:
            return None
        self._at[worker] = group.golden
        for place, piece in enumerate(group.again):
            if self._may_try(worker, piece):
                del group.again[place]
                return piece
        runs = list(islice(group.runs, self._runs()))
        lines = {name: line for run in runs for name, line in run.items()}
        group.left -= len(lines)
        return self._piece(Kind.RUN, group.golden, lines, runs=len(runs))

    def _runs(self) -> int:
        if not self._done[Kind.RUN]:
            return _FIRST
        mean_s = self._mean_s(Kind.RUN)
        share_s = self._waiting * mean_s / (_SHARE * self._at_once)
        return max(1, round(min(MOST_S, max(LEAST_S, share_s)) / mean_s)) if mean_s else _FIRST

    def _group_for(self, worker: str) -> Group | None:
        """Return the worker's group or, if that has no work, the group with the most work per worker."""
        own = self._groups.get(self._at.get(worker, ""))
        if own is not None and self._has_for(own, worker):
            return own
        there = Counter(self._at.values())
        waiting = [group for group in self._groups.values() if self._has_for(group, worker)]
        return max(waiting, key=lambda group: group.waiting / (1 + there[group.golden]), default=None)

    def _has_for(self, group: Group, worker: str) -> bool:
        return bool(group.left) or any(self._may_try(worker, piece) for piece in group.again)

    def _may_try(self, worker: str, piece: Piece) -> bool:
        """Return whether the piece has not killed the worker, or has killed every worker present."""
        return worker not in piece.died_at or self._slots.keys() <= set(piece.died_at)

    def _proof_for(self, worker: str) -> Piece | None:
        """Return a piece of the proof with an experiment that another worker or an earlier session ran.

        A worker proves its own experiments only if it is the only worker, or after a long idle time.
        """
        running = {name for out in self._out.values() for name in out.piece.lines if name in self._sampled}
        idle_s = self._now() - self._idle_since.get(worker, self._now())
        takes_own = len(self._slots) <= 1 or idle_s > max(_PROOF_S, _LATE * self._mean_s(Kind.RUN))
        for place, piece in enumerate(self._proof):
            name = next(iter(piece.lines))
            other = not (name in running or self._maker.get(name) == worker)
            if (takes_own or other) and self._may_try(worker, piece):
                return self._proof.pop(place)
        return None

    def _late_for(self, worker: str) -> Piece | None:
        now = self._now()
        late = [
            (now - out.since - out.expected_s, out.piece)
            for out in self._out.values()
            if worker != out.worker
            and not out.others
            and self._may_try(worker, out.piece)
            and now - out.since > max(_LATE * out.expected_s, _LATE_S)
        ]
        return max(late, key=lambda one: one[0])[1] if late else None

    def _piece(
        self, kind: Kind, golden: str, lines: Run, *, runs: int = 1, died_at: tuple[str, ...] = ()
    ) -> Piece:
        self._number += 1
        return Piece(
            number=self._number,
            kind=kind,
            golden=golden,
            lines=lines,
            faults=faults_of(lines, self._faults),
            runs=runs,
            died_at=died_at,
        )

    def _proof_piece(self, line: bytes) -> Piece:
        lines = {id_on_line(line): line}
        return self._piece(Kind.PROVE, golden_of(self._folder, line, self._faults), lines)

    def _part(self, piece: Piece, lines: Run, died_at: tuple[str, ...]) -> Piece:
        return self._piece(piece.kind, piece.golden, lines, runs=len(lines), died_at=died_at)

    def _again(self, piece: Piece) -> None:
        if piece.kind is Kind.PROVE:
            self._proof.append(piece)
        else:
            self._groups[piece.golden].again.append(piece)
