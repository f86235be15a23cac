"""Search, validation and repair of a plane, on made-up planes."""

from collections.abc import Callable

from mutator.campaigns.exploration_section import ExplorationSection, ExploredPlane
from mutator.explore.cell_results import CellState, Drive
from mutator.explore.lattice import Cell
from mutator.explore.plane_exploration import MOST_VALIDATIONS, PlaneExploration
from tests.unit.mutator.explore.made_planes import LATTICE, STEP_S, Truth, falling_curve, result_of

DRIVE = Drive(start_s=0.0, end_s=60.0, step_s=STEP_S)
PLANE = ExploredPlane(
    spec="sensor/bias/distance",
    scenario="A",
    start="0",
    condition="t >= 0",
    magnitudes=[magnitude for magnitude in LATTICE.magnitudes if magnitude is not None],
    durations_s=list(LATTICE.durations_s),
)


def exploration_of(**values: int) -> PlaneExploration:
    section = ExplorationSection(planes=[PLANE], **values)
    return PlaneExploration(plane=PLANE, drive=DRIVE, section=section, seed=1, number=0)


def explore(
    plane: PlaneExploration, truth: Truth, most: int = 16, visit: Callable[[Cell], None] = lambda cell: None
) -> None:
    while cells := plane.propose(most):
        for cell, _ in cells:
            visit(cell)
            plane.note(cell, result_of(truth, plane.map.lattice, cell))


def test_validation_draws_cells_that_are_called_without_hazard() -> None:
    """86 of them, each once, none of which was driven; no hazard is found in them."""
    driven: list[Cell] = []
    plane = exploration_of()
    explore(plane, falling_curve(1), visit=driven.append)
    [validation] = plane.validations
    assert len(set(validation.drawn)) == len(validation.drawn) == 86 < validation.frame_size
    assert len(set(driven)) == len(driven)
    assert driven[-86:] == list(validation.drawn)
    assert plane.failures(validation) == []


def test_a_small_frame_is_driven_whole() -> None:
    """A census where there are fewer cells than draws."""
    plane = exploration_of(validation=5000)
    explore(plane, falling_curve(1))
    [validation] = plane.validations
    assert len(validation.drawn) == validation.frame_size < 5000
    assert not any(state is CellState.BETWEEN_WITHOUT for line in plane.cells() for state in line)


def test_what_a_validation_contradicts_is_repaired_and_validated_anew() -> None:
    """An island that the search misses: the lines of failed draws are swept, so more of it is hazardous, and
    new cells are drawn.
    """

    def truth(magnitude: float, duration_s: float) -> float | None:
        # where neither a sweep nor a look comes
        is_inside = LATTICE.magnitudes.index(magnitude) in range(9, 12) and 1.0 < duration_s < 2.5
        return 30.0 if is_inside else None

    plane = exploration_of(validation=200)
    explore(plane, truth)
    assert plane.failures(plane.validations[0])
    assert 2 <= len(plane.validations) <= MOST_VALIDATIONS
    drawn = [cell for validation in plane.validations for cell in validation.drawn]
    assert len(set(drawn)) == len(drawn)
    lines = {line for line, _ in plane.failures(plane.validations[0])}
    cells = plane.cells()
    for line in lines:
        hazardous = [LATTICE.durations_s[j] for j, state in enumerate(cells[line]) if state.is_hazardous]
        assert hazardous == [duration for duration in LATTICE.durations_s if 1.0 < duration < 2.5]


def test_validations_end() -> None:
    """A plane in which every draw fails is validated four times."""
    island = {cell for cell in ((i, j) for i in range(51) for j in range(44)) if sum(cell) % 3 == 0}

    def truth(magnitude: float, duration_s: float) -> float | None:
        cell = LATTICE.magnitudes.index(magnitude), LATTICE.durations_s.index(duration_s)
        return 50.0 if cell in island else None

    plane = exploration_of(validation=20, search=60)
    explore(plane, truth)
    assert len(plane.validations) <= MOST_VALIDATIONS


def test_the_search_has_a_budget() -> None:
    """After its runs, cells stay unknown, and only what is called without hazard is validated."""
    plane = exploration_of(search=30, validation=10)
    explore(plane, falling_curve(2))
    assert len(plane.map.results) <= 30 + len(plane.validations[0].drawn)
    assert any(state is CellState.UNKNOWN for line in plane.cells() for state in line)


def test_durations_that_leave_no_time_are_not_called_without_hazard() -> None:
    """Of a drive of 20 s, only faults of up to 5 s can be observed for 15 s."""
    section = ExplorationSection(planes=[PLANE], validation=0)
    drive = Drive(start_s=0.0, end_s=20.0, step_s=STEP_S)
    plane = PlaneExploration(plane=PLANE, drive=drive, section=section, seed=1, number=0)
    assert LATTICE.durations_s[plane.decidable - 1] <= 5.0 < LATTICE.durations_s[plane.decidable]
    explore(plane, lambda magnitude, duration_s: None)
    longer = range(plane.decidable, len(LATTICE.durations_s) - 1)
    assert {plane.cells()[0][j] for j in range(plane.decidable)} <= {
        CellState.WITHOUT_HAZARD,
        CellState.BETWEEN_WITHOUT,
    }
    assert all((0, j) not in plane.map.results for j in longer)
