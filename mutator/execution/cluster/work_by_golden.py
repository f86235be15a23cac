"""The pending work of a run folder, grouped by golden run. Plan lines are read on demand."""

from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import groupby
from typing import Any

from mutator.campaigns.chunks import PendingChunk
from mutator.execution.cluster.pieces import Piece
from mutator.store import plan_file
from mutator.store.plan_lines import id_on_line, parse_experiment, parse_fault, values_behind_id
from mutator.store.run_folder import RunFolder

_OF_A_RUN = ("fault", "trigger", "seed")  # equal for experiments that share a run

Run = dict[str, bytes]  # plan lines of the experiments that share one run, by experiment id
Faults = Mapping[str, bytes]  # lines of the plan's faults by id


@dataclass
class Group:
    """The remaining experiments that have the same golden run."""

    golden: str
    runs: Iterator[Run]
    left: int  # experiments not yet put into a piece
    again: deque[Piece] = field(default_factory=deque)  # returned pieces

    @property
    def waiting(self) -> int:
        return self.left + sum(len(piece.lines) for piece in self.again)


def groups_of(folder: RunFolder, pending: Sequence[PendingChunk], faults: Faults) -> dict[str, Group]:
    """Return the pending work by golden run. All experiments of a chunk have the same golden run."""
    chunks: dict[str, list[PendingChunk]] = {}
    for one in pending:
        first = next(iter(plan_file.read_chunk_lines(folder.path, folder.head.chunks[one.chunk_index])))
        chunks.setdefault(golden_of(folder, first, faults), []).append(one)
    return {
        golden: Group(golden, _runs_of(folder, ours), sum(len(one.places) for one in ours))
        for golden, ours in chunks.items()
    }


def _runs_of(folder: RunFolder, pending: Sequence[PendingChunk]) -> Iterator[Run]:
    for one in pending:
        lines = list(plan_file.read_chunk_lines(folder.path, folder.head.chunks[one.chunk_index]))
        for _, same in groupby((lines[place] for place in one.places), key=_what_runs):
            yield {id_on_line(line): line for line in same}


def _what_runs(line: bytes) -> list[Any]:
    data = values_behind_id(line)
    return [data[name] for name in _OF_A_RUN]


def golden_of(folder: RunFolder, line: bytes, faults: Faults) -> str:
    fault = parse_fault(faults[values_behind_id(line)["fault"]])
    return folder.golden_run_of(parse_experiment(line, {fault.id: fault})).key


def faults_of(lines: Run, faults: Faults) -> tuple[bytes, ...]:
    return tuple(dict.fromkeys(faults[values_behind_id(line)["fault"]] for line in lines.values()))
