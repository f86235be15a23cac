"""Envelopes of made-up planes."""

from collections.abc import Callable

from mutator.campaigns.exploration_section import ExplorationSection, ExploredPlane
from mutator.explore.cell_results import CellResult, CellState, Drive
from mutator.explore.envelope import Envelope
from mutator.explore.lattice import durations_between, magnitudes_between
from mutator.explore.plane_exploration import PlaneExploration
from tests.unit.mutator.explore.made_planes import STEP_S, Truth, result_of

DRIVE = Drive(start_s=5.0, end_s=60.0, step_s=STEP_S)
MADE_PLANE = ExploredPlane(
    spec="sensor/bias/distance",
    scenario="A",
    start="5",
    condition="t >= 5.0",
    magnitudes=list(magnitudes_between(0.5, 50.0, 13)),
    durations_s=list(durations_between(STEP_S, 10.0, 12, STEP_S)),
    unit="m",
)


def line(magnitude: float, duration_s: float) -> float | None:
    """Faults of 5 m and more are hazardous 2 s after they began, if they last for a second."""
    return 2.0 if abs(magnitude) >= 5.0 and duration_s >= 1.0 else None


def never(magnitude: float, duration_s: float) -> float | None:
    return None


def envelope_of(
    truth: Truth,
    plane: ExploredPlane = MADE_PLANE,
    *,
    most_runs: int = 10_000,
    drive: Drive = DRIVE,
    validation: int = 10,
    observe_s: float = 15.0,
    crashes: Callable[[float, float], bool] = lambda magnitude, duration_s: False,
    without_result: CellState = CellState.NOT_DECIDED,
) -> Envelope:
    """Explore a plane, up to `most_runs` runs. Those of faults for which `crashes` holds have the state
    `without_result`.
    """
    section = ExplorationSection(planes=[plane], validation=validation, observe_s=observe_s)
    explored = PlaneExploration(plane=plane, drive=drive, section=section, seed=1, number=0)
    count = 0
    while count < most_runs and (cells := explored.propose(min(8, most_runs - count))):
        count += len(cells)
        for cell in cells:
            lattice = explored.map.lattice
            result = result_of(truth, lattice, cell)
            if crashes(lattice.magnitudes[cell[0]] or 0.0, lattice.durations_s[cell[1]]):
                reason = "ValueError: no lead"
                result = CellResult(state=without_result, experiment_id=str(cell), reason=reason)
            explored.note(cell, result)
    return Envelope(explored)
