"""Where a made-up plane first fails, and how far its validation reaches."""

import pytest

from mutator.explore.cell_results import CellState
from mutator.explore.envelope_failures import (
    ValidationCount,
    count_validation,
    first_failure,
    hazardous_share,
)
from mutator.explore.envelope_texts import describe_envelope
from tests.unit.mutator.explore.made_envelopes import envelope_of, line, never


def test_the_first_failure_is_the_smallest_then_the_shortest() -> None:
    """It was driven, and the run beside it is a shorter one of the same magnitude without a hazard."""
    envelope = envelope_of(line)
    failure = first_failure(envelope)
    assert failure and failure.magnitude == min(m for m in envelope.magnitudes if m and m >= 5.0)
    assert failure.duration_s >= 1.0 and failure.result.state is CellState.HAZARDOUS
    assert failure.neighbour and failure.neighbour.state is CellState.WITHOUT_HAZARD


def test_the_first_failure_is_that_of_the_command_line() -> None:
    """The shortest hazardous cell of the smallest magnitude that has one, inferred or not."""
    envelope = envelope_of(lambda m, d: 0.6 if m >= 5 and d >= 3 else None)
    failure = first_failure(envelope)
    assert failure and failure.state is CellState.INFERRED and failure.result.state is CellState.HAZARDOUS
    assert describe_envelope(envelope).endswith(
        f"{failure.magnitude:g} m for {failure.duration_s:g} s is hazardous"
    )


def test_a_shorter_duration_has_its_own_failure() -> None:
    """No fault below a second fails."""
    assert first_failure(envelope_of(line), 0.5) is None
    assert first_failure(envelope_of(never)) is None


def test_the_share_of_hazardous_cells_tells_planes_apart() -> None:
    """Between nothing and everything."""
    assert hazardous_share(envelope_of(never)) == 0.0 < hazardous_share(envelope_of(line)) < 1.0


@pytest.mark.parametrize(
    ("frame", "drawn", "failed", "most"),
    [(10_000, 86, 0, 0.05), (40_000, 436, 0, 0.01), (10_000, 86, 1, 0.075), (200, 100, 0, 0.05)],
)
def test_a_draw_bounds_the_share(frame: int, drawn: int, failed: int, most: float) -> None:
    """86 draws without a failure show 5 %, 436 show 1 %, each at 98.75 %; with failures, more is possible.
    Half of a small frame shows more than the same number of draws from a large one.
    """
    count = ValidationCount(frame=frame, drawn=drawn, driven=drawn, hazardous=failed)
    assert 0.5 * most < count.most_hazardous_share <= most


def test_a_census_needs_no_bound() -> None:
    """Where all cells are drawn, the share is known."""
    count = ValidationCount(frame=4, drawn=4, driven=4, hazardous=1)
    assert count.is_census and count.most_hazardous_share == 0.25


def test_a_draw_that_was_cut_off_is_unfinished() -> None:
    """Only what was driven counts as driven."""
    whole = envelope_of(line)
    cut = envelope_of(line, most_runs=whole.run_count - 2)
    assert cut.validation and whole.validation
    count = count_validation(cut, cut.validation)
    assert (count.drawn - count.driven, count.is_complete) == (2, False)
    assert count_validation(whole, whole.validation).is_complete
    assert not cut.exploration.is_complete and whole.exploration.is_complete
