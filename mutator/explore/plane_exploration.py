"""The exploration of one plane: search, validation, repair of what a validation contradicts, challenges."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from mutator._common.random_streams import random_generator
from mutator.campaigns.exploration_section import ExplorationSection, ExploredPlane
from mutator.explore.cell_results import CellResult, CellState, Drive
from mutator.explore.challengers import is_challenger, seed_form, seed_number
from mutator.explore.challenges import Bound, ChallengedCell, Challenges, bounds_of
from mutator.explore.lattice import Cell, Lattice
from mutator.explore.plane_map import Line, PlaneMap
from mutator.explore.plane_search import PlaneSearch, cells_with

MOST_VALIDATIONS = 4  # the first, and one after each of at most three repairs
_REPAIR_RUNS = 16  # for the line of a cell that a validation finds hazardous
_CALLED_WITHOUT_HAZARD = (CellState.BETWEEN_WITHOUT,)


@dataclass(frozen=True, slots=True, kw_only=True)
class Validation:
    """Cells drawn, without replacement, from the `frame_size` undriven ones called without hazard."""

    frame_size: int
    drawn: tuple[Cell, ...]


class FormOfCell(NamedTuple):
    """A cell to drive. `form` is another seed of its fault, or a challenger; empty for the fault itself."""

    cell: Cell
    form: str = ""


@dataclass(slots=True)
class PlaneExploration:
    """What is driven next in a plane, which depends on its results so far alone.

    `seed` and `number`, the plane's in its exploration, decide what validations draw.
    """

    plane: ExploredPlane
    drive: Drive
    section: ExplorationSection
    seed: int
    number: int
    map: PlaneMap = field(init=False)
    challenges: Challenges = field(init=False)
    validations: list[Validation] = field(default_factory=list)
    _awaited: set[Cell] = field(default_factory=set)
    _awaited_challenges: set[ChallengedCell] = field(default_factory=set)
    _results_by_seed: dict[Cell, dict[str, CellResult]] = field(default_factory=dict)
    _repaired_lines: set[int] = field(default_factory=set)
    _search_runs: int = 0
    _is_searching: bool = True
    _proposals: list[Cell] | None = None  # of the search, with the results so far

    def __post_init__(self) -> None:
        magnitudes = tuple(self.plane.magnitudes) or (None,)
        lattice = Lattice(magnitudes=magnitudes, durations_s=tuple(self.plane.durations_s))
        self.map = PlaneMap(lattice)
        self.challenges = Challenges(self.plane.challengers, lattice, self.drive.step_s)

    @property
    def decidable(self) -> int:
        """How many durations, at least one, leave time to observe what follows."""
        last_s = self.drive.end_s - self.drive.start_s - self.section.observe_s + self.drive.step_s / 2
        return max(1, sum(duration <= last_s for duration in self.map.lattice.durations_s))

    @property
    def is_complete(self) -> bool:
        """Whether nothing is left to drive."""
        if not self._is_explored:
            return False
        if self.plane.challengers and not self.challenges.bounds:  # they have not begun, if there are any
            return not any(self._bounds())
        return not self.challenges.next_cells()

    @property
    def _is_explored(self) -> bool:
        """Whether nothing but challenges is left to drive."""
        if self._awaited or (self._is_searching and self.section.validation):
            return False
        if self._is_searching:
            return not self._next_in_search()
        validation = self.validations[-1]
        is_last = len(self.validations) == MOST_VALIDATIONS or not self.failures(validation)
        return is_last and not self._not_proposed(validation.drawn)

    @property
    def is_search_cut_off(self) -> bool:
        """Whether the search ended by its limit of runs, with lines that it did not close."""
        return not self._is_searching and not self._search().is_closed

    def cells(self) -> list[Line]:
        """Return the state of every cell, by magnitude and duration."""
        return self.map.cells(self._search().closed_lines())

    def failures(self, validation: Validation) -> list[Cell]:
        """Return the drawn cells that were not survived."""
        states = ((cell, self.map.state(cell)) for cell in validation.drawn)
        return [cell for cell, state in states if state and state.is_failed]

    def propose(self, most: int) -> list[FormOfCell]:
        """Return some cells to drive next, each with all its seeds: at most `most` runs, or those of one
        cell. None while results are awaited, and at the end.
        """
        forms = [seed_form(number) for number in range(self.plane.seeds)]
        cells = self._next_cells()[: max(1, most // len(forms))]
        self._awaited |= set(cells)
        self._search_runs += len(cells) if self._is_searching else 0
        if cells or not self._is_explored:
            return [FormOfCell(cell, form) for cell in cells for form in forms]
        return self._next_challenges(most)

    def _next_challenges(self, most: int) -> list[FormOfCell]:
        if not self.challenges.bounds:
            self.challenges.bounds = list(self._bounds())
        cells = [c for c in self.challenges.next_cells() if c not in self._awaited_challenges][:most]
        self._awaited_challenges |= set(cells)
        return [FormOfCell(cell, name) for cell, name in cells]

    def _bounds(self) -> Iterable[Bound]:
        return bounds_of(self.cells(), self.map.lattice, self.decidable) if self.plane.challengers else ()

    def note(self, cell: Cell, result: CellResult, form: str = "") -> None:
        """Take the result of a proposed cell. It has one of its own once all its seeds have."""
        if is_challenger(form):
            self._awaited_challenges.discard((cell, form))
            self.challenges.results[cell, form] = result
            return
        by_seed = self._results_by_seed.setdefault(cell, {})
        by_seed[form] = result
        if len(by_seed) == self.plane.seeds:
            self._awaited.discard(cell)
            self.map.add(cell, result_of_all_seeds(self._results_by_seed.pop(cell)))
            self._proposals = None

    def _search(self) -> PlaneSearch:
        return PlaneSearch(
            plane=self.map, decidable=self.decidable, repaired_lines=frozenset(self._repaired_lines)
        )

    def _next_cells(self) -> list[Cell]:
        if self._is_searching:
            if cells := self._next_in_search():
                return cells
            if self._awaited or not self.section.validation:
                return []
            self._begin_validation()
        undriven = self._not_proposed(self.validations[-1].drawn)
        failed = {line for line, _ in self.failures(self.validations[-1])}
        if undriven or self._awaited or not failed or len(self.validations) == MOST_VALIDATIONS:
            return undriven
        self._repaired_lines |= failed
        self._proposals = None
        self._is_searching = True
        return self._next_cells()

    def _next_in_search(self) -> list[Cell]:
        budget = self.section.search + _REPAIR_RUNS * len(self._repaired_lines) - self._search_runs
        if self._proposals is None:
            self._proposals = self._search().proposals()
        return self._not_proposed(self._proposals)[: max(0, budget)]

    def _begin_validation(self) -> None:
        frame = list(cells_with(_CALLED_WITHOUT_HAZARD, self.cells()))
        key = f"explore/{self.number}/validation {len(self.validations) + 1}"
        order = random_generator(self.seed, key).permutation(len(frame))[: self.section.validation]
        drawn = tuple(frame[int(i)] for i in sorted(order))
        self._is_searching = False
        self.validations.append(Validation(frame_size=len(frame), drawn=drawn))

    def _not_proposed(self, cells: Iterable[Cell]) -> list[Cell]:
        return [cell for cell in cells if cell not in self._awaited and cell not in self.map.results]


def result_of_all_seeds(results: Mapping[str, CellResult]) -> CellResult:
    """Return what the runs of a cell say together: it is without hazard only if each is."""
    ordered = [results[form] for form in sorted(results, key=seed_number)]
    for state in (CellState.HAZARDOUS, CellState.NOT_DECIDED, CellState.DISENGAGED):
        for result in ordered:
            if result.state is state:
                return replace(result, is_judged=all(r.is_judged for r in ordered))
    first = ordered[0].margins
    margins = {name: min(r.margins.get(name, value) for r in ordered) for name, value in first.items()}
    return replace(ordered[0], margins=margins, is_activated=any(r.is_activated for r in ordered))
