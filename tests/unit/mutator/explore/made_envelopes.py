"""Envelopes of made-up planes."""

from collections.abc import Callable

from mutator.campaigns.exploration_section import ExplorationSection, ExploredPlane
from mutator.explore.cell_results import CellResult, CellState, Drive
from mutator.explore.challengers import is_challenger
from mutator.explore.envelope import Envelope
from mutator.explore.lattice import Cell, durations_between, magnitudes_between
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


FormHolds = Callable[[str, float, float], bool]  # for a form, a magnitude and a duration


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
    challengers: FormHolds = lambda name, magnitude, duration_s: True,
    challenger_state: CellState = CellState.HAZARDOUS,
    seeds_hit: FormHolds = lambda form, magnitude, duration_s: False,
) -> Envelope:
    """Explore a plane, up to `most_runs` runs. Those of faults for which `crashes` holds have the state
    `without_result`. Challengers are survived where `challengers` holds, else they have `challenger_state`;
    seeds for which `seeds_hit` holds have a hazard.
    """
    section = ExplorationSection(planes=[plane], validation=validation, observe_s=observe_s)
    explored = PlaneExploration(plane=plane, drive=drive, section=section, seed=1, number=0)
    count = 0
    while count < most_runs and (cells := explored.propose(min(8, most_runs - count))):
        count += len(cells)
        for cell, form in cells:
            lattice = explored.map.lattice
            magnitude, duration_s = lattice.magnitudes[cell[0]] or 0.0, lattice.durations_s[cell[1]]
            result = result_of(truth, lattice, cell)
            if crashes(magnitude, duration_s):
                reason = "ValueError: no lead"
                result = CellResult(
                    state=without_result, experiment_id=str(cell), reason=reason, is_judged=False
                )
            if is_challenger(form):
                result = _challenger_result(
                    challengers(form, magnitude, duration_s), cell, form, challenger_state
                )
            elif seeds_hit(form, magnitude, duration_s):
                result = _challenger_result(False, cell, form, CellState.HAZARDOUS)
            explored.note(cell, result, form)
    return Envelope(explored)


def _challenger_result(is_survived: bool, cell: Cell, form: str, state: CellState) -> CellResult:
    name = f"{cell} {form}"
    if is_survived:
        return CellResult(state=CellState.WITHOUT_HAZARD, experiment_id=name)
    if state is not CellState.HAZARDOUS:
        return CellResult(state=state, experiment_id=name, reason="ValueError: no lead")
    return CellResult(state=state, experiment_id=name, hazard="H1", time_to_hazard_s=3.0)
