"""The experiments of a plan by id, parsed on access."""

from array import array
from collections.abc import Iterator, Mapping
from pathlib import Path

from mutator.errors import MutatorError
from mutator.model import Experiment
from mutator.store import plan_file
from mutator.store.indexed_lines import OpenFiles
from mutator.store.plan_lines import id_on_line, read_plan_lines
from mutator.store.planned_scenarios import planned_scenarios_of


class PlannedExperiments(Mapping[str, Experiment]):
    """The experiments of the run folder at `run`, in plan order.

    Reading a line that is damaged or does not match its id raises MutatorError.
    """

    def __init__(self, run: Path) -> None:
        self._path = run / plan_file.EXPERIMENTS_FILE
        self._faults = plan_file.load_faults(run)
        self._scenarios = planned_scenarios_of(run)
        self._files = OpenFiles([self._path])
        self._index: dict[str, int] = {}
        self._offsets = array("Q", [0])
        offset = 0
        for number, line in enumerate(read_plan_lines(self._path)):
            self._offsets.append(offset := offset + len(line))
            try:
                name = id_on_line(line)
            except MutatorError:
                name = str(number)  # the line is reported when it is read
            self._index.setdefault(name, number)

    def __getitem__(self, name: str) -> Experiment:
        number = self._index[name]
        begin, end = self._offsets[number : number + 2]
        line = self._files.read_part(0, begin, end - begin)
        experiment = plan_file.parse_experiment_line(self._path, number + 1, line, self._faults)
        return plan_file.with_concrete_scenario(experiment, self._scenarios)

    def __contains__(self, name: object) -> bool:
        return name in self._index

    def __iter__(self) -> Iterator[str]:
        return iter(self._index)

    def __len__(self) -> int:
        return len(self._index)
