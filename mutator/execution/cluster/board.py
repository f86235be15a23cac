"""The board: which worker does which piece of work next. It knows no network and starts nothing.

Pieces are cut when they are asked for, each so long that all workers come to the end at about the same time:
a share of what is left, by the times that were measured so far. Work of the golden run that a worker has goes
to that worker. Near the end, who has nothing else to do repeats what others are late with.
"""

import json
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import groupby, islice
from typing import Any

from mutator.campaigns.chunks import Pending
from mutator.execution.cluster.pieces import Kind, Piece
from mutator.store import plan_file
from mutator.store.run_folder import RunFolder
from mutator.verification.equivalence import Sample

LEAST_S, MOST_S = 0.5, 8.0  # of a piece
_SHARE = 4  # of what is left, a worker gets one part in so many times the workers
_FIRST = 4  # runs in a piece before anything was measured
_GUESS_S = 0.5  # a run takes, before anything was measured
_LATE = 3.0  # times the expected time after which a piece is repeated elsewhere
_LATE_S = 5.0  # and at least so long
_DEATHS = 2  # of workers, until a piece is split
_PROOF_S = 20.0  # without other work, until a worker proves what it ran itself

_OF_A_RUN = ("fault", "trigger", "seed")  # equal in experiments that are one run in several scenarios

Run = dict[str, bytes]  # lines of the plan by experiment id: a run, and those that share it


@dataclass
class _Group:
    """What is left of the work with one golden run."""

    golden: str
    runs: Iterator[Run]
    left: int  # experiments that were not cut off yet
    again: deque[Piece] = field(default_factory=deque)  # pieces that came back

    @property
    def waiting(self) -> int:
        return self.left + sum(len(piece.lines) for piece in self.again)


@dataclass
class _Out:
    """A piece that is being done: by whom, since when, and how long it was expected to take."""

    piece: Piece
    worker: str
    since: float
    expected_s: float
    others: set[str] = field(default_factory=set)  # workers that repeat it


class Board:
    """Deals out the pending work of a run folder. `now` is a clock, in seconds."""

    def __init__(
        self,
        folder: RunFolder,
        pending: Sequence[Pending],
        proof: Sequence[Sample],
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        self._now, self._folder = now, folder
        self._number = 0
        self._faults = plan_file.fault_lines(folder.path)
        self._groups = _groups(folder, pending, self._faults)
        self._sampled = {sample.id for sample in proof}
        self._proof = [self._proof_piece(line) for line in plan_file.lines_named(folder.path, self._sampled)]
        self._out: dict[int, _Out] = {}
        self._maker: dict[str, str] = {}  # of the sample's experiments that were run now: by which worker
        self._at: dict[str, str] = {}  # the golden run that each worker has
        self._slots: dict[str, int] = {}  # pieces that each worker that is there does at once
        self._idle_since: dict[str, float] = {}
        self._seconds = dict.fromkeys(Kind, 0.0)
        self._done: Counter[Kind] = Counter()

    def join(self, worker: str, slots: int) -> None:
        """A worker is there that does so many pieces at once."""
        self._slots[worker] = slots

    def leave(self, worker: str) -> None:
        """A worker is gone, or gets no more work."""
        for known in (self._slots, self._at, self._idle_since):
            known.pop(worker, None)

    @property
    def is_empty(self) -> bool:
        """Whether all work is done."""
        return not (self._out or self._proof or self._waiting)

    @property
    def ran_all(self) -> bool:
        """Whether nothing but proof is left."""
        outstanding = any(out.piece.kind is Kind.RUN for out in self._out.values())
        return not (self._waiting or outstanding)

    def drop_proof(self) -> None:
        """Nothing needs a proof."""
        self._proof.clear()

    def take(self, worker: str, *, ahead: bool = False) -> Piece | None:
        """The next piece for a worker; None where there is none for now. What a worker takes `ahead` it has
        while it does another: near the end there is nothing of that kind."""
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
        """A piece came back done; False when it counts no more, as somebody else's did before."""
        if self._out.pop(piece.number, None) is None:
            return False
        self._seconds[piece.kind] += seconds
        self._done[piece.kind] += piece.runs
        if piece.kind is Kind.RUN:
            self._maker.update((name, worker) for name in piece.lines if name in self._sampled)
        return True

    def give_back(self, piece: Piece, worker: str) -> None:
        """A worker does not do a piece after all, for reasons that are not the piece's."""
        if (out := self._out.get(piece.number)) is None:
            return
        if worker in out.others:
            out.others.discard(worker)
        elif out.others:
            out.worker = out.others.pop()
        else:
            del self._out[piece.number]
            self._again(piece)

    def died(self, piece: Piece, worker: str, at: str = "") -> Piece | None:
        """A worker died of a piece, maybe while it ran the experiment `at`. What died twice is split; returns
        a piece of one experiment that died twice: it is given up."""
        if piece.number not in self._out:
            return None
        del self._out[piece.number]
        piece = replace(piece, deaths=piece.deaths + 1)
        if len(piece.lines) == 1 and piece.deaths >= _DEATHS:
            return piece
        if at in piece.lines and len(piece.lines) > 1:
            rest = {name: line for name, line in piece.lines.items() if name != at}
            self._again(self._part(piece, {at: piece.lines[at]}, piece.deaths))
            self._again(self._part(piece, rest, 0))
        elif piece.deaths >= _DEATHS:
            names = list(piece.lines)
            for half in (names[: len(names) // 2], names[len(names) // 2 :]):
                self._again(self._part(piece, {name: piece.lines[name] for name in half}, _DEATHS - 1))
        else:
            self._again(piece)
        return None

    def remaining_s(self) -> float | None:
        """How long the work that is left will take; None before anything was measured."""
        if not self._done[Kind.RUN] and not self._done[Kind.PROVE]:
            return None
        out = sum(max(0.0, one.expected_s - (self._now() - one.since)) for one in self._out.values())
        proof_s = len(self._proof) * self._mean_s(Kind.PROVE)
        return (self._waiting * self._mean_s(Kind.RUN) + proof_s + out) / self._at_once

    @property
    def _at_once(self) -> int:
        return max(1, sum(self._slots.values()))

    @property
    def _waiting(self) -> int:
        return sum(group.waiting for group in self._groups.values())

    def _mean_s(self, kind: Kind) -> float:
        """What a run takes."""
        return self._seconds[kind] / self._done[kind] if self._done[kind] else _GUESS_S

    def _cut(self, worker: str) -> Piece | None:
        group = self._group_for(worker)
        if group is None:
            return None
        self._at[worker] = group.golden
        if group.again:
            return group.again.popleft()
        runs = list(islice(group.runs, self._runs()))
        lines = {name: line for run in runs for name, line in run.items()}
        group.left -= len(lines)
        return self._piece(Kind.RUN, group.golden, lines, runs=len(runs))

    def _runs(self) -> int:
        """How many runs the next piece has."""
        if not self._done[Kind.RUN]:
            return _FIRST
        mean_s = self._mean_s(Kind.RUN)
        share_s = self._waiting * mean_s / (_SHARE * self._at_once)
        return max(1, round(min(MOST_S, max(LEAST_S, share_s)) / mean_s)) if mean_s else _FIRST

    def _group_for(self, worker: str) -> _Group | None:
        """The work with the golden run that the worker has; else that with the most left for each worker."""
        own = self._groups.get(self._at.get(worker, ""))
        if own is not None and own.waiting:
            return own
        there = Counter(self._at.values())
        waiting = [group for group in self._groups.values() if group.waiting]
        return max(waiting, key=lambda group: group.waiting / (1 + there[group.golden]), default=None)

    def _proof_for(self, worker: str) -> Piece | None:
        """An experiment of the proof that another worker ran, or that was run before; its own, where there
        are no others, or where they have left it for long."""
        running = {name for out in self._out.values() for name in out.piece.lines if name in self._sampled}
        idle_s = self._now() - self._idle_since.get(worker, self._now())
        takes_own = len(self._slots) <= 1 or idle_s > _PROOF_S
        for place, piece in enumerate(self._proof):
            name = next(iter(piece.lines))
            if takes_own or not (name in running or self._maker.get(name) == worker):
                return self._proof.pop(place)
        return None

    def _late_for(self, worker: str) -> Piece | None:
        """A piece that another worker is late with."""
        now = self._now()
        late = [
            (now - out.since - out.expected_s, out.piece)
            for out in self._out.values()
            if worker != out.worker
            and not out.others
            and now - out.since > max(_LATE * out.expected_s, _LATE_S)
        ]
        return max(late, key=lambda one: one[0])[1] if late else None

    def _piece(self, kind: Kind, golden: str, lines: Run, *, runs: int = 1, deaths: int = 0) -> Piece:
        self._number += 1
        return Piece(
            number=self._number,
            kind=kind,
            golden=golden,
            lines=lines,
            faults=_faults_of(lines, self._faults),
            runs=runs,
            deaths=deaths,
        )

    def _proof_piece(self, line: bytes) -> Piece:
        lines = {_read(line)["id"]: line}
        return self._piece(Kind.PROVE, _golden_of(self._folder, line, self._faults), lines)

    def _part(self, piece: Piece, lines: Run, deaths: int) -> Piece:
        return self._piece(piece.kind, piece.golden, lines, runs=len(lines), deaths=deaths)

    def _again(self, piece: Piece) -> None:
        if piece.kind is Kind.PROVE:
            self._proof.append(piece)
        else:
            self._groups[piece.golden].again.append(piece)


_Faults = Mapping[str, bytes]  # lines of the plan's faults by id


def _groups(folder: RunFolder, pending: Sequence[Pending], faults: _Faults) -> dict[str, _Group]:
    """The pending work by golden run. A chunk has one."""
    chunks: dict[str, list[Pending]] = {}
    for one in pending:
        first = next(iter(plan_file.chunk_lines(folder.path, folder.head["chunks"][one.chunk])))
        chunks.setdefault(_golden_of(folder, first, faults), []).append(one)
    return {
        golden: _Group(golden, _runs_of(folder, ours), sum(len(one.places) for one in ours))
        for golden, ours in chunks.items()
    }


def _runs_of(folder: RunFolder, pending: Sequence[Pending]) -> Iterator[Run]:
    """What is left of these chunks, run by run: those that share one are side by side."""
    for one in pending:
        lines = list(plan_file.chunk_lines(folder.path, folder.head["chunks"][one.chunk]))
        read = [(_read(lines[place]), lines[place]) for place in one.places]
        for _, same in groupby(read, key=lambda item: [item[0][key] for key in _OF_A_RUN]):
            yield {data["id"]: line for data, line in same}


def _golden_of(folder: RunFolder, line: bytes, faults: _Faults) -> str:
    data = _read(line)
    fault = plan_file.fault_from(json.loads(faults[data["fault"]]))
    experiment = plan_file.experiment_from(data, {fault.id: fault})
    return folder.golden_of(experiment).key


def _faults_of(lines: Run, faults: _Faults) -> tuple[bytes, ...]:
    """The lines of the faults that these experiments have, each once."""
    return tuple(dict.fromkeys(faults[_read(line)["fault"]] for line in lines.values()))


def _read(line: bytes) -> dict[str, Any]:
    data: dict[str, Any] = json.loads(line)
    return data
