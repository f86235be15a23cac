"""How often the search of an envelope finds islands of hazardous cells, on made-up planes.

`python benchmarks/islands.py [--planes 100] [--seed 1]`. A plane of 51 x 51 cells has a curve that falls with
the magnitude, or none, and an island at least three cells away from it, whose hazard comes after the fault's
end. With a slope, margins fall towards the island and the curve over so many cells. An island is hit if a run
is in it. A cell is far from the border if no cell beside it, also at corners, is of the other kind.
"""

import argparse
import random
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import product
from statistics import mean
from time import process_time

from mutator.campaigns.exploration_section import ExplorationSection, ExploredPlane
from mutator.explore.cell_results import CellResult, CellState, Drive
from mutator.explore.exploration import BATCHES_IN_FLIGHT
from mutator.explore.lattice import Cell
from mutator.explore.plane_exploration import PlaneExploration

POINTS, STEP_S, DISTANCE = 51, 0.01, 3
MAGNITUDES = [100 ** (i / (POINTS - 1)) for i in range(POINTS)]
DURATIONS_S = [round(0.1 * 150 ** (i / (POINTS - 1)), 2) for i in range(POINTS)]
KINDS = ((0, 0), (3, 0), (4, 0), (5, 0), (6, 0), (8, 0), (3, 4), (3, 8), (3, 12), (5, 8))  # size, slope


@dataclass
class MadeUpPlane:
    """The truth of a plane. `hazards` has the time to the hazard of each hazardous cell, in s."""

    seed: int
    size: int
    slope: int
    hazards: dict[Cell, float] = field(default_factory=dict)
    island: set[Cell] = field(default_factory=set)

    def __post_init__(self) -> None:
        rng = random.Random(self.seed)
        while True:
            self.hazards = dict(_falling_curve(rng)) if rng.random() < 0.8 else {}
            if not self.size or self._has_island(rng):
                return

    def _has_island(self, rng: random.Random) -> bool:
        """Whether there is room for an island, which then is part of the plane."""
        for _ in range(100):
            i, j = rng.randrange(POINTS - self.size + 1), rng.randrange(POINTS - self.size + 1)
            beside = product(
                range(i - DISTANCE, i + self.size + DISTANCE), range(j - DISTANCE, j + self.size + DISTANCE)
            )
            if not self.hazards.keys() & set(beside):
                self.island = set(product(range(i, i + self.size), range(j, j + self.size)))
                self.hazards |= {cell: DURATIONS_S[cell[1]] + 1.0 for cell in self.island}
                return True
        return False

    def result(self, cell: Cell) -> CellResult:
        time_s = self.hazards.get(cell)
        if time_s is None:
            margins = {"margin": self._margin(cell)} if self.slope else {}
            return CellResult(state=CellState.WITHOUT_HAZARD, experiment_id=str(cell), margins=margins)
        needed_s = time_s + 2 * STEP_S
        return CellResult(
            state=CellState.HAZARDOUS,
            experiment_id=str(cell),
            hazard="H1",
            time_to_hazard_s=time_s,
            inferred_from_s=needed_s if needed_s <= DURATIONS_S[cell[1]] else None,
        )

    def _margin(self, cell: Cell) -> float:
        i, j = cell
        for distance in range(1, self.slope):
            square = range(-distance, distance + 1)
            if any((i + a, j + b) in self.hazards for a in square for b in square):
                return distance / self.slope
        return 1.0

    def is_far(self, cell: Cell) -> bool:
        i, j = cell
        beside = product(range(max(i - 1, 0), min(i + 2, POINTS)), range(max(j - 1, 0), min(j + 2, POINTS)))
        return all((other in self.hazards) is (cell in self.hazards) for other in beside)


def _falling_curve(rng: random.Random) -> Iterator[tuple[Cell, float]]:
    exponent, scale = rng.uniform(0.3, 1.5), rng.uniform(0.1, 10.0)
    least, delay_s = rng.uniform(0.5, 20.0), rng.uniform(0.0, 5.0)
    for i, j in product(range(POINTS), range(POINTS)):
        if MAGNITUDES[i] > least:
            needed_s = scale / (MAGNITUDES[i] - 0.9 * least) ** exponent
            if DURATIONS_S[j] >= needed_s:
                yield (i, j), needed_s + delay_s


@dataclass(frozen=True, kw_only=True)
class Figures:
    """What an exploration did."""

    search_runs: int
    runs: int
    is_in_search: bool  # the island was found before the validation
    is_found: bool
    far_cells: int
    unknown_cells: int
    ms_per_run: float


def explored(truth: MadeUpPlane) -> Figures:
    plane = ExploredPlane(
        spec="made/up/plane",
        scenario="",
        start="0",
        condition="t >= 0",
        magnitudes=MAGNITUDES,
        durations_s=DURATIONS_S,
    )
    section = ExplorationSection(planes=[plane])
    drive = Drive(start_s=0.0, end_s=60.0, step_s=STEP_S)
    exploration = PlaneExploration(plane=plane, drive=drive, section=section, seed=truth.seed, number=0)
    searched: list[Cell] = []
    in_flight: deque[list[Cell]] = deque()
    used_s = 0.0
    while True:
        begin_s = process_time()
        while len(in_flight) < BATCHES_IN_FLIGHT and (batch := exploration.propose(section.batch)):
            cells = [cell for cell, _ in batch]
            in_flight.append(cells)
            searched += [] if exploration.validations else cells
        used_s += process_time() - begin_s
        if not in_flight:
            break
        for cell in in_flight.popleft():
            exploration.note(cell, truth.result(cell))
    return _figures(truth, exploration, searched, used_s)


def _figures(
    truth: MadeUpPlane, exploration: PlaneExploration, searched: list[Cell], used_s: float
) -> Figures:
    driven = exploration.map.results.keys()
    states = {(i, j): state for i, line in enumerate(exploration.cells()) for j, state in enumerate(line)}
    stated = [cell for cell, state in states.items() if state.is_hazardous or state.is_without_hazard]
    wrong = [cell for cell in stated if states[cell].is_hazardous is not (cell in truth.hazards)]
    return Figures(
        search_runs=len(searched),
        runs=len(driven),
        is_in_search=bool(truth.island & set(searched)),
        is_found=bool(truth.island & driven),
        far_cells=sum(map(truth.is_far, wrong)),
        unknown_cells=len(states) - len(stated),
        ms_per_run=1e3 * used_s / len(driven),
    )


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--planes", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    print(
        "island slope | hit by search, with validation | search runs, all | planes with far cells | unknown"
    )
    for size, slope in KINDS:
        planes = [MadeUpPlane(options.seed * 10_000 + n, size, slope) for n in range(options.planes)]
        figures = [explored(plane) for plane in planes]
        print(
            f"{f'{size} x {size}' if size else 'none':6} {slope:5} | "
            f"{mean(f.is_in_search for f in figures):5.0%} {mean(f.is_found for f in figures):5.0%} | "
            f"{mean(f.search_runs for f in figures):4.0f} {mean(f.runs for f in figures):4.0f} | "
            f"{mean(f.far_cells > 0 for f in figures):5.0%} | "
            f"{mean(f.unknown_cells for f in figures) / POINTS**2:5.1%} | "
            f"{mean(f.ms_per_run for f in figures):.2f} ms to propose a run",
            flush=True,
        )
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
