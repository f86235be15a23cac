"""The experiments of a plan by id, parsed on access."""

import json
import re
from array import array
from collections.abc import Iterator, Mapping
from pathlib import Path

from mutator.model import Experiment
from mutator.store import plan_file
from mutator.store.indexed_lines import Files

_ID = re.compile(rb'"id":"([^"\\]+)"')


class Planned(Mapping[str, Experiment]):
    """The experiments of the run folder at `run`, in plan order.

    Reading a line that is damaged or does not match its id raises MutatorError.
    """

    def __init__(self, run: Path) -> None:
        self._path = run / plan_file.EXPERIMENTS
        self._faults = plan_file.read_faults(run)
        self._files = Files([self._path])
        self._index: dict[str, int] = {}
        self._offsets = array("Q", [0])
        for number, line in enumerate(plan_file.lines_of(self._path)):
            self._offsets.append(self._offsets[-1] + len(line))
            self._index.setdefault(_id(line) or str(number), number)

    def __getitem__(self, name: str) -> Experiment:
        number = self._index[name]
        begin, end = self._offsets[number : number + 2]
        line = self._files.read(0, begin, end - begin)
        return plan_file.experiment_on(self._path, number + 1, line, self._faults)

    def __contains__(self, name: object) -> bool:
        return name in self._index

    def __iter__(self) -> Iterator[str]:
        return iter(self._index)

    def __len__(self) -> int:
        return len(self._index)


def _id(line: bytes) -> str | None:
    """Return the id on a line; None for a damaged line, which is reported when it is read."""
    if found := _ID.search(line):
        return found[1].decode()
    try:
        return str(json.loads(line)["id"])
    except (KeyError, TypeError, ValueError, RecursionError):
        return None
