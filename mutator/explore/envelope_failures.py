"""Where an envelope first fails, and how far its validation reaches."""

from dataclasses import dataclass
from math import exp, lgamma

from mutator.explore.cell_results import CellResult, CellState
from mutator.explore.envelope import Envelope
from mutator.explore.plane_exploration import Validation

CONFIDENCE_OF_EACH_LOOK = 0.9875  # 95 % for four looks together


@dataclass(frozen=True, slots=True, kw_only=True)
class Failure:
    """The smallest magnitude that led to a hazard, and the shortest duration for which it did.

    `neighbour` is the next shorter run of the same magnitude, which had no hazard; None without one.
    """

    magnitude: float | None
    duration_s: float
    result: CellResult
    neighbour: CellResult | None


def first_failure(envelope: Envelope, longest_s: float | None = None) -> Failure | None:
    """Return the first failure among the cells that were driven; with `longest_s`, among those up to the
    first duration that is at least as long. None if none was driven to a hazard.
    """
    results = envelope.exploration.map.results
    count = len(envelope.durations_s) if longest_s is None else envelope.columns_up_to(longest_s)
    for i, magnitude in enumerate(envelope.magnitudes):
        for j, duration_s in enumerate(envelope.durations_s[:count]):
            result = results.get((i, j))
            if result and result.state is CellState.HAZARDOUS:
                before = results.get((i, j - 1))
                is_survived = before is not None and before.state is CellState.WITHOUT_HAZARD
                neighbour = before if is_survived else None
                return Failure(magnitude=magnitude, duration_s=duration_s, result=result, neighbour=neighbour)
    return None


def hazardous_share(envelope: Envelope) -> float:
    """Return the share of hazardous cells among those of which anything is said; 0 if there is none."""
    states = [state for line in envelope.cells for state in line]
    hazardous = sum(state.is_hazardous for state in states)
    stated = hazardous + sum(state.is_without_hazard for state in states)
    return hazardous / stated if stated else 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class ValidationCount:
    """What a validation found: of `drawn` cells out of `frame`, `driven` were driven, of which some were
    `hazardous` and some `undecided`.
    """

    frame: int
    drawn: int
    driven: int
    hazardous: int
    undecided: int = 0

    @property
    def is_complete(self) -> bool:
        return self.driven == self.drawn

    @property
    def is_census(self) -> bool:
        """Whether every cell was drawn."""
        return self.drawn == self.frame

    @property
    def most_hazardous_share(self) -> float:
        """The upper limit of the share of hazardous cells, at `CONFIDENCE_OF_EACH_LOOK`: exact, for a draw
        without replacement. Cells that were not decided count as hazardous.
        """
        failed = self.hazardous + self.undecided
        low, high = failed, self.frame - self.drawn + failed
        while low < high:  # the largest number of hazardous cells that is not refuted
            middle = (low + high + 1) // 2
            if self._probability_of_at_most(failed, middle) > 1 - CONFIDENCE_OF_EACH_LOOK:
                low = middle
            else:
                high = middle - 1
        return low / self.frame if self.frame else 0.0

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
    )


def _log_of_choices(count: int, chosen: int) -> float:
    return lgamma(count + 1) - lgamma(chosen + 1) - lgamma(count - chosen + 1)
