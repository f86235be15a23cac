"""What follows from a plane's results."""

from dataclasses import replace

import pytest

from mutator.errors import MutatorError
from mutator.explore.cell_results import CellResult, CellState
from mutator.explore.lattice import Lattice
from mutator.explore.plane_map import PlaneMap

LATTICE = Lattice(magnitudes=(1.0, 2.0), durations_s=(0.1, 0.5, 1.0, 2.0))
HAZARD = CellResult(
    state=CellState.HAZARDOUS, experiment_id="short", hazard="H1", time_to_hazard_s=0.4, inferred_from_s=0.42
)
NO_HAZARD = CellResult(state=CellState.WITHOUT_HAZARD, experiment_id="long")
DISENGAGED = replace(NO_HAZARD, state=CellState.DISENGAGED)


def test_longer_faults_have_the_hazard_of_a_shorter_active_one() -> None:
    """From 0.42 s on, so for three of four durations of this line, of which one was driven."""
    plane = PlaneMap(LATTICE)
    plane.add((1, 1), HAZARD)
    states = [plane.state((1, j)) for j in range(4)]
    assert states == [None, CellState.HAZARDOUS, CellState.INFERRED, CellState.INFERRED]
    assert plane.proof_of((1, 3)) == HAZARD and plane.state((0, 3)) is None


@pytest.mark.parametrize(
    "order",
    [
        [((1, 1), HAZARD), ((1, 3), NO_HAZARD)],
        [((1, 3), NO_HAZARD), ((1, 1), HAZARD)],
        [((1, 1), HAZARD), ((1, 3), DISENGAGED)],
        [((1, 1), HAZARD), ((1, 3), replace(NO_HAZARD, state=CellState.NOT_DECIDED))],
    ],
)
def test_a_contradiction_is_an_error(order: list[tuple[tuple[int, int], CellResult]]) -> None:
    """Runs that differ before the hazard are not of one deterministic target, so nothing may be inferred."""
    plane = PlaneMap(LATTICE)
    plane.add(*order[0])
    with pytest.raises(MutatorError, match="long has no hazard, but the shorter fault of experiment short"):
        plane.add(*order[1])


def test_a_crash_contradicts_nothing() -> None:
    """Nobody judged whether the hazard came before it."""
    plane = PlaneMap(LATTICE)
    plane.add((1, 1), HAZARD)
    plane.add((1, 3), replace(DISENGAGED, is_judged=False))
    assert plane.state((1, 3)) is CellState.DISENGAGED
