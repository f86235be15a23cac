"""Islands of hazardous cells in made-up planes without any other hazard."""

import random
from itertools import product

import pytest

from mutator.explore.cell_results import CellState
from mutator.explore.hidden_islands import places_to_look
from mutator.explore.plane_map import PlaneMap
from tests.unit.mutator.explore.made_planes import LATTICE, Island, called, searched_island

LINES, DURATIONS = len(LATTICE.magnitudes), len(LATTICE.durations_s)


def islands(size: int, slope: int = 0, count: int = 20) -> list[Island]:
    rng = random.Random(size)
    firsts = [(rng.randrange(LINES - size), rng.randrange(DURATIONS - size)) for _ in range(count)]
    return [Island(first=first, size=size, slope=slope) for first in firsts]


def is_hit(plane: PlaneMap) -> bool:
    return any(result.state is CellState.HAZARDOUS for result in plane.results.values())


def test_an_island_is_found_by_the_margins_beside_it() -> None:
    """If the margin falls over eight cells, an island of 3 x 3 is found within the 120 runs of a search."""
    assert sum(is_hit(searched_island(island)) for island in islands(3, slope=8)) >= 19


def test_an_island_without_margins_is_found_if_it_is_large() -> None:
    """Of 8 x 8 cells always, of 5 x 5 mostly."""
    assert all(is_hit(searched_island(island)) for island in islands(8))
    assert sum(is_hit(searched_island(island)) for island in islands(5)) >= 15


@pytest.mark.parametrize("first", [(12, 14), (27, 30)])
def test_an_island_has_its_borders(first: tuple[int, int]) -> None:
    """Once it is found, no cell is wrong that does not touch one of the other kind."""
    island = Island(first=first, size=4, slope=8)
    cells = called(searched_island(island, most=250))
    for i, j in product(range(LINES), range(DURATIONS)):
        if cells[i][j].is_hazardous is not (island.distance((i, j)) == 0):
            assert island.distance((i, j)) <= 1
    assert cells[first[0] + 1][first[1] + 1].is_hazardous


def test_each_place_is_far_from_all_others() -> None:
    """Without any margin, places are looked into until each square of 3 x 3 cells has one."""
    plane = PlaneMap(LATTICE)
    cells = [[CellState.BETWEEN_WITHOUT] * DURATIONS for _ in range(LINES)]
    while places := places_to_look(plane, cells, DURATIONS):
        for i, j in places:
            assert cells[i][j] is CellState.BETWEEN_WITHOUT
            cells[i][j] = CellState.WITHOUT_HAZARD
    for i, j in product(range(LINES - 2), range(DURATIONS - 2)):
        assert any(cells[i + a][j + b] is CellState.WITHOUT_HAZARD for a in range(3) for b in range(3))


def test_no_place_is_too_long_to_be_observed() -> None:
    cells = [[CellState.BETWEEN_WITHOUT] * DURATIONS for _ in range(LINES)]
    assert all(j < 20 for _, j in places_to_look(PlaneMap(LATTICE), cells, 20))
