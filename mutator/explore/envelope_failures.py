"""Where an envelope first fails, and how far its validation reaches."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import exp, lgamma

from mutator.explore.cell_results import CellResult, CellState
from mutator.explore.envelope import Envelope
from mutator.explore.lattice import Cell
from mutator.explore.plane_exploration import Validation

CONFIDENCE_OF_EACH_LOOK = 0.9875  # so that all looks, at most four, hold together at the next one
CONFIDENCE_OF_ALL_LOOKS = 0.95


@dataclass(frozen=True, slots=True, kw_only=True)
class Failure:
    """The smallest magnitude with a hazardous cell, and its shortest hazardous duration.

    `state` says how the cell is called hazardous. `result` is the run that proves it, of a shorter fault if
    it is inferred; if it lies between runs, the nearest hazardous run, which is no proof. `neighbour` is the
    run of the next shorter fault of the same magnitude, which had no hazard; None without one.
    """

    magnitude: float | None
    duration_s: float
    state: CellState
    result: CellResult
    neighbour: CellResult | None


def first_failure(envelope: Envelope, longest_s: float | None = None) -> Failure | None:
    """Return the first failure; with `longest_s`, among the cells up to the first duration that is at least
    as long. None if no cell is called hazardous.
    """
    results = envelope.exploration.map.results
    count = len(envelope.durations_s) if longest_s is None else envelope.columns_up_to(longest_s)
    for i, line in enumerate(envelope.cells):
        j = next((j for j, state in enumerate(line[:count]) if state.is_hazardous), None)
        if j is None or (result := nearest_hazardous_result(envelope, (i, j))) is None:
            continue
        before = results.get((i, j - 1))
        is_survived = before is not None and before.state is CellState.WITHOUT_HAZARD
        return Failure(
            magnitude=envelope.magnitudes[i],
            duration_s=envelope.durations_s[j],
            state=line[j],
            result=result,
            neighbour=before if is_survived else None,
        )
    return None


def nearest_hazardous_result(envelope: Envelope, cell: Cell) -> CellResult | None:
    """Return the run that proves a hazardous cell; without one, the nearest hazardous run of its line, then
    of the plane. None if no run had a hazard.
    """
    plane_map = envelope.exploration.map
    proof = plane_map.proof_of(cell)
    if proof is not None and proof.state is CellState.HAZARDOUS:
        return proof
    return _nearest_result(envelope, cell, (CellState.HAZARDOUS,), len(envelope.durations_s))


def nearest_undecided_result(envelope: Envelope, cell: Cell) -> CellResult | None:
    """Return the run that is nearest to a cell, of those that leave time to observe and have no result, or
    ended disengaged.
    """
    return _nearest_result(
        envelope, cell, (CellState.NOT_DECIDED, CellState.DISENGAGED), envelope.columns_up_to()
    )


def _nearest_result(
    envelope: Envelope, cell: Cell, states: Sequence[CellState], columns: int
) -> CellResult | None:
    results = envelope.exploration.map.results
    line, duration = cell
    cells = [other for other, result in results.items() if result.state in states and other[1] < columns]
    nearest = min(cells, key=lambda c: (abs(c[0] - line), abs(c[1] - duration), c), default=None)
    return None if nearest is None else results[nearest]


def undecided_results(envelope: Envelope) -> list[CellResult]:
    """Return the runs that decide nothing although their faults leave time to observe what follows."""
    count = envelope.columns_up_to()
    results = sorted(envelope.exploration.map.results.items())
    return [r for (_, j), r in results if j < count and r.state is CellState.NOT_DECIDED]


def undecided_cell_count(envelope: Envelope) -> int:
    """Return the number of cells whose faults leave time to observe, but of which nothing is said."""
    count = envelope.columns_up_to()
    states = (state for line in envelope.cells for state in line[:count])
    return sum(not state.is_failed and not state.is_without_hazard for state in states)


def disengaged_cells(envelope: Envelope) -> list[Cell]:
    """Return the driven cells without a hazard in which the controller ended disengaged or crashed."""
    results = envelope.exploration.map.results.items()
    return sorted(cell for cell, result in results if result.state is CellState.DISENGAGED)


def hazardous_share(envelope: Envelope) -> float:
    """Return the share of hazardous cells among those of which anything is said; 0 if there is none."""
    states = [state for line in envelope.cells for state in line]
    hazardous = sum(state.is_hazardous for state in states)
    stated = hazardous + sum(state.is_without_hazard for state in states)
    return hazardous / stated if stated else 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class ValidationCount:
    """What a validation found: of `drawn` cells out of `frame`, `driven` were driven, of which some were
    `hazardous`, some `undecided`, and in some the controller ended `disengaged`.
    """

    frame: int
    drawn: int
    driven: int
    hazardous: int
    undecided: int = 0
    disengaged: int = 0

    @property
    def is_complete(self) -> bool:
        return self.driven == self.drawn

    @property
    def is_census(self) -> bool:
        """Whether every cell was drawn."""
        return self.drawn == self.frame

    @property
    def most_hazardous_share(self) -> float:
        """The upper limit of the share of the frame that is hazardous: see `most_hazardous_count`."""
        return self.most_hazardous_count / self.frame if self.frame else 0.0

    @property
    def most_hazardous_count(self) -> int:
        """The upper limit of the number of hazardous cells in the frame, at `CONFIDENCE_OF_EACH_LOOK`: exact,
        for a draw without replacement. Cells that were not decided, or not survived, count as hazardous.
        """
        failed = self.hazardous + self.undecided + self.disengaged
        low, high = failed, self.frame - self.drawn + failed
        while low < high:  # the largest number of hazardous cells that is not refuted
            middle = (low + high + 1) // 2
            if self._probability_of_at_most(failed, middle) > 1 - CONFIDENCE_OF_EACH_LOOK:
                low = middle
            else:
                high = middle - 1
        return low

    def _probability_of_at_most(self, failed: int, hazardous: int) -> float:
        least = max(0, self.drawn - (self.frame - hazardous))
        total = _log_of_choices(self.frame, self.drawn)
        return sum(
            exp(
                _log_of_choices(hazardous, count)
                + _log_of_choices(self.frame - hazardous, self.drawn - count)
                - total
            )
            for count in range(least, failed + 1)
        )


def count_validation(envelope: Envelope, validation: Validation) -> ValidationCount:
    results = [envelope.exploration.map.results.get(cell) for cell in validation.drawn]
    driven = [result.state for result in results if result]
    return ValidationCount(
        frame=validation.frame_size,
        drawn=len(results),
        driven=len(driven),
        hazardous=driven.count(CellState.HAZARDOUS),
        undecided=driven.count(CellState.NOT_DECIDED),
        disengaged=driven.count(CellState.DISENGAGED),
    )


def _log_of_choices(count: int, chosen: int) -> float:
    return lgamma(count + 1) - lgamma(chosen + 1) - lgamma(count - chosen + 1)
