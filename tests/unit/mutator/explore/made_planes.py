"""Planes with a made-up truth, and their search without any run."""

import random
from collections.abc import Callable
from dataclasses import dataclass

from mutator.explore.cell_results import CellResult, CellState
from mutator.explore.lattice import Cell, Lattice, durations_between, magnitudes_between
from mutator.explore.plane_map import PlaneMap
from mutator.explore.plane_search import PlaneSearch

# time from the start of the fault to a hazard, for a magnitude and a duration; None without a hazard
Truth = Callable[[float, float], float | None]
STEP_S = 0.01
MOST_RUNS = 120  # of the search of a plane
LATTICE = Lattice(
    magnitudes=magnitudes_between(0.6, 60.0, 51), durations_s=durations_between(STEP_S, 15.0, 51, STEP_S)
)


def falling_curve(seed: int) -> Truth:
    """A fault above a least magnitude is hazardous after a duration that falls with the magnitude, some time
    after its end.
    """
    rng = random.Random(seed)
    exponent, scale = rng.uniform(0.3, 1.5), rng.uniform(2, 200)
    least, delay_s = rng.uniform(0.5, 20.0), rng.uniform(0.0, 5.0)

    def truth(magnitude: float, duration_s: float) -> float | None:
        if magnitude < least:
            return None
        needed_s = 0.05 * scale / (magnitude - 0.9 * least) ** exponent
        return needed_s + delay_s if duration_s >= needed_s else None

    return truth


@dataclass(frozen=True, kw_only=True)
class Island:
    """Faults with a hazard one second after their end, of `size` magnitudes and durations each, from `first`
    on. The margin of others falls towards them, over `slope` cells, if that is not 0.
    """

    first: Cell
    size: int
    slope: int = 0

    def distance(self, cell: Cell) -> int:
        """Return the distance of a cell in cells; 0 inside."""
        beyond = (
            max(start - number, number - start - self.size + 1)
            for start, number in zip(self.first, cell, strict=True)
        )
        return max(0, *beyond)

    def result_of(self, cell: Cell) -> CellResult:
        """Return the result of a cell of `LATTICE`."""
        distance = self.distance(cell)
        if distance:
            margins = {"h1": min(1.0, distance / self.slope)} if self.slope else {}
            return CellResult(state=CellState.WITHOUT_HAZARD, experiment_id=str(cell), margins=margins)
        return result_of(lambda magnitude, duration_s: duration_s + 1.0, LATTICE, cell)


def searched_island(island: Island, most: int = MOST_RUNS, at_once: int = 8) -> PlaneMap:
    """Search a plane with nothing but an island."""
    plane = PlaneMap(LATTICE)
    while (
        cells := PlaneSearch(plane=plane, decidable=len(LATTICE.durations_s)).proposals()[:at_once]
    ) and len(plane.results) < most:
        for cell in cells[: most - len(plane.results)]:
            plane.add(cell, island.result_of(cell))
    return plane


def result_of(truth: Truth, lattice: Lattice, cell: Cell) -> CellResult:
    magnitude, duration_s = lattice.magnitudes[cell[0]], lattice.durations_s[cell[1]]
    time_s = truth(magnitude or 0.0, duration_s)
    if time_s is None:
        return CellResult(state=CellState.WITHOUT_HAZARD, experiment_id=str(cell))
    needed_s = time_s + 2 * STEP_S
    return CellResult(
        state=CellState.HAZARDOUS,
        experiment_id=str(cell),
        hazard="H1",
        time_to_hazard_s=time_s,
        inferred_from_s=needed_s if needed_s <= duration_s else None,
    )


def search(truth: Truth, lattice: Lattice = LATTICE, at_once: int = 8, most: int = MOST_RUNS) -> PlaneMap:
    """Search a plane with at most so many runs, `at_once` cells at a time."""
    plane = PlaneMap(lattice)
    while cells := PlaneSearch(plane=plane, decidable=len(lattice.durations_s)).proposals()[:at_once]:
        if len(plane.results) == most:
            break
        for cell in cells[: most - len(plane.results)]:
            plane.add(cell, result_of(truth, lattice, cell))
    return plane


def called(plane: PlaneMap) -> list[list[CellState]]:
    decidable = len(plane.lattice.durations_s)
    return plane.cells(PlaneSearch(plane=plane, decidable=decidable).closed_lines())
