"""The pending work of a run folder, grouped by golden run. Plan lines are read on demand."""

from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import groupby
from typing import Any

from mutator.campaigns.chunks import PendingChunk
from mutator.execution.cluster.piece_messages import Piece
from mutator.store import plan_file
from mutator.store.plan_lines import id_on_line, parse_experiment, parse_fault, values_hashed_into_id
from mutator.store.run_folder import RunFolder

_FIELDS_OF_SHARED_RUN = ("fault", "trigger", "seed")  # equal for experiments that share a run

PlanLinesOfRun = dict[str, bytes]  # plan lines of the experiments that share one run, by experiment id
FaultLineById = Mapping[str, bytes]  # lines of the plan's faults by id


@dataclass
class GoldenRunGroup:
    """The remaining experiments that have the same golden run."""

    golden_key: str
    uncut_runs: Iterator[PlanLinesOfRun]
    uncut_experiment_count: int  # experiments not yet put into a piece
    returned_pieces: deque[Piece] = field(default_factory=deque)  # returned pieces

    @property
    def waiting_experiment_count(self) -> int:
        return self.uncut_experiment_count + sum(len(piece.plan_lines) for piece in self.returned_pieces)


def group_by_golden(
    folder: RunFolder, pending: Sequence[PendingChunk], faults: FaultLineById
) -> dict[str, GoldenRunGroup]:
    """Return the pending work by golden run. All experiments of a chunk have the same golden run."""
    chunks: dict[str, list[PendingChunk]] = {}
    for chunk_work in pending:
        first = next(
            iter(plan_file.read_chunk_lines(folder.path, folder.head.chunks[chunk_work.chunk_index]))
        )
        chunks.setdefault(golden_key_of(folder, first, faults), []).append(chunk_work)
    return {
        golden: GoldenRunGroup(
            golden,
            _list_runs(folder, chunk_works),
            sum(len(chunk_work.pending_positions) for chunk_work in chunk_works),
        )
        for golden, chunk_works in chunks.items()
    }


def _list_runs(folder: RunFolder, pending: Sequence[PendingChunk]) -> Iterator[PlanLinesOfRun]:
    for chunk_work in pending:
        lines = list(plan_file.read_chunk_lines(folder.path, folder.head.chunks[chunk_work.chunk_index]))
        for _, same in groupby((lines[place] for place in chunk_work.pending_positions), key=_shared_run_key):
            yield {id_on_line(line): line for line in same}


def _shared_run_key(line: bytes) -> list[Any]:
    data = values_hashed_into_id(line)
    return [data[name] for name in _FIELDS_OF_SHARED_RUN]


def golden_key_of(folder: RunFolder, line: bytes, faults: FaultLineById) -> str:
    fault = parse_fault(faults[values_hashed_into_id(line)["fault"]])
    return folder.golden_run_of(parse_experiment(line, {fault.id: fault})).key


def fault_lines_of(lines: PlanLinesOfRun, faults: FaultLineById) -> tuple[bytes, ...]:
    return tuple(dict.fromkeys(faults[values_hashed_into_id(line)["fault"]] for line in lines.values()))
