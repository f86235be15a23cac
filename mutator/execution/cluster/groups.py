"""The pending work of a run folder, grouped by golden run. Plan lines are read on demand."""

import json
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import groupby
from typing import Any

from mutator.campaigns.chunks import Pending
from mutator.execution.cluster.pieces import Piece
from mutator.store import plan_file
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


def groups_of(folder: RunFolder, pending: Sequence[Pending], faults: Faults) -> dict[str, Group]:
    """Return the pending work by golden run. All experiments of a chunk have the same golden run."""
    chunks: dict[str, list[Pending]] = {}
    for one in pending:
        first = next(iter(plan_file.chunk_lines(folder.path, folder.head["chunks"][one.chunk])))
        chunks.setdefault(golden_of(folder, first, faults), []).append(one)
    return {
        golden: Group(golden, _runs_of(folder, ours), sum(len(one.places) for one in ours))
        for golden, ours in chunks.items()
    }


def _runs_of(folder: RunFolder, pending: Sequence[Pending]) -> Iterator[Run]:
    for one in pending:
        lines = list(plan_file.chunk_lines(folder.path, folder.head["chunks"][one.chunk]))
        read = [(_read(lines[place]), lines[place]) for place in one.places]
        for _, same in groupby(read, key=lambda item: [item[0][key] for key in _OF_A_RUN]):
            yield {data["id"]: line for data, line in same}


def golden_of(folder: RunFolder, line: bytes, faults: Faults) -> str:
    data = _read(line)
    fault = plan_file.fault_from(json.loads(faults[data["fault"]]))
    experiment = plan_file.experiment_from(data, {fault.id: fault})
    return folder.golden_of(experiment).key


def faults_of(lines: Run, faults: Faults) -> tuple[bytes, ...]:
    return tuple(dict.fromkeys(faults[_read(line)["fault"]] for line in lines.values()))


def id_of(line: bytes) -> str:
    return str(_read(line)["id"])


def _read(line: bytes) -> dict[str, Any]:
    data: dict[str, Any] = json.loads(line)
    return data
