"""The search of a plane, on made-up planes."""

import math
from itertools import product

import pytest

from mutator.explore.cell_results import CellState
from mutator.explore.lattice import Lattice
from mutator.explore.plane_map import PlaneMap
from mutator.explore.plane_search import LEAST_SWEPT_DURATIONS, PlaneSearch
from tests.unit.mutator.explore.made_planes import LATTICE, Truth, called, falling_curve, search

MAGNITUDES, DURATIONS = LATTICE.magnitudes, LATTICE.durations_s


def is_hazardous(truth: Truth, i: int, j: int) -> bool:
    return truth(MAGNITUDES[i] or 0.0, DURATIONS[j]) is not None


@pytest.mark.parametrize("seed", range(20))
def test_a_falling_curve_is_drawn_within_a_cell(seed: int) -> None:
    """Of some 2,200 cells, the search drives at most 140; a wrong cell touches one of the other kind."""
    truth = falling_curve(seed)
    plane = search(truth, most=140)
    cells = called(plane)
    for i, j in product(range(len(MAGNITUDES)), range(len(DURATIONS))):
        assert cells[i][j] is not CellState.UNKNOWN
        if cells[i][j].is_hazardous is not is_hazardous(truth, i, j):
            beside = product(range(max(i - 1, 0), i + 2), range(max(j - 1, 0), j + 2))
            inside = ((a, b) for a, b in beside if a < len(MAGNITUDES) and b < len(DURATIONS))
            assert any(is_hazardous(truth, a, b) is not is_hazardous(truth, i, j) for a, b in inside)


def test_the_mean_search_is_short() -> None:
    """With 120 runs, nothing stays unknown in most planes with a falling curve."""
    unknown = [
        any(state is CellState.UNKNOWN for line in called(search(falling_curve(seed))) for state in line)
        for seed in range(20)
    ]
    assert sum(unknown) <= 4


def test_a_line_without_hazard_is_swept() -> None:
    """A line counts as without hazard only where at least eight durations were driven: a plane without any
    hazard has seven such lines.
    """
    plane = search(lambda magnitude, duration_s: None)
    by_line = [sum(i == line for i, _ in plane.results) for line in range(len(MAGNITUDES))]
    assert sum(count >= LEAST_SWEPT_DURATIONS for count in by_line) >= 7
    assert {state for line in called(plane) for state in line} == {
        CellState.WITHOUT_HAZARD,
        CellState.BETWEEN_WITHOUT,
    }


def test_the_longest_duration_does_not_decide_a_line() -> None:
    """Longer faults are survived, but not those of 3 to 7 s."""
    plane = search(lambda magnitude, duration_s: 20.0 if 3.0 <= duration_s <= 7.0 else None)
    hazardous = [DURATIONS[j] for j, state in enumerate(called(plane)[20]) if state.is_hazardous]
    assert hazardous == [duration for duration in DURATIONS if 3.0 <= duration <= 7.0]


def test_an_island_of_the_largest_magnitudes_is_hazardous() -> None:
    """A distance that wraps at 256 m is dangerous at the end of its range alone."""
    cells = called(
        search(lambda magnitude, duration_s: 1.0 if magnitude > 48.0 and duration_s > 1.0 else None)
    )
    for i, magnitude in enumerate(MAGNITUDES):
        assert cells[i][-1].is_hazardous is (magnitude is not None and magnitude > 48.0)


def test_a_fault_without_value_is_driven_for_every_duration() -> None:
    """One line costs less than a plane, so nothing hides in it, not even an island of two cells."""
    lattice = Lattice(magnitudes=(None,), durations_s=DURATIONS)
    truth = lambda magnitude, duration_s: 30.0 if 9.0 <= duration_s <= 12.0 else None  # noqa: E731
    plane = search(truth, lattice)
    [line] = called(plane)
    assert [state.is_hazardous for state in line] == [9.0 <= duration <= 12.0 for duration in DURATIONS]


def test_what_follows_by_causality_is_not_driven() -> None:
    """A fault that causes its hazard in 0.2 s, while it is active, is not driven for longer than one of the
    first cells after that.
    """
    plane = search(lambda magnitude, duration_s: 0.2 if duration_s >= 0.2 else None)
    line = len(MAGNITUDES) - 1
    driven = [DURATIONS[j] for i, j in plane.results if i == line]
    assert sorted(driven)[-2] <= 0.3 and max(driven) == DURATIONS[-1]
    assert called(plane)[line][30] is CellState.INFERRED


def test_proposals_depend_on_the_results_alone() -> None:
    """Whatever the order of the results, the same cells come next."""
    plane = search(falling_curve(3), at_once=40)
    part = dict(list(plane.results.items())[:60])
    proposals = []
    for results in (part.items(), reversed(part.items())):
        again = PlaneMap(LATTICE)
        for cell, result in results:
            again.add(cell, result)
        proposals.append(PlaneSearch(plane=again, decidable=len(DURATIONS)).proposals())
    assert proposals[0] == proposals[1] != []


def test_shorter_faults_than_the_driven_ones_are_not_called_hazardous() -> None:
    """A band of hazardous durations that widens and narrows with the magnitude: lines between two searched
    ones can begin with a hazard, but their shortest fault has none.
    """

    def band(magnitude: float, duration_s: float) -> float | None:
        size = math.log(magnitude / 3.0)
        first_s = 0.3 * math.exp(0.6 * size)
        last_s = first_s * math.exp(1.5 * (1.0 + 0.7 * math.sin(2.0 * size)))
        is_hazardous = magnitude >= 3.0 and first_s <= duration_s <= last_s
        return duration_s + 1.0 if is_hazardous else None

    cells = called(search(band))
    assert any(state is CellState.HAZARDOUS for line in cells for state in line)
    assert not any(line[0].is_hazardous for line in cells)
