"""What an envelope says of its cells, on made-up planes."""

from dataclasses import replace

import pytest

from mutator.explore.cell_results import CellState, Drive
from tests.unit.mutator.explore.made_envelopes import MADE_PLANE, envelope_of, line, never
from tests.unit.mutator.explore.made_planes import STEP_S


def test_what_is_survived_covers_shorter_faults() -> None:
    """For a duration, each shorter one is survived, too: hazard is monotone in nothing."""
    glitch = envelope_of(lambda magnitude, duration_s: 3.0 if magnitude >= 5 and duration_s < 0.05 else None)
    largest = glitch.largest_survived(2.0)
    assert largest is not None and largest < 5
    assert glitch.state_at(50.0, 2.0).is_without_hazard


def test_the_duration_that_counts_is_not_shorter_than_the_one_asked_for() -> None:
    """The cells of 1 s are hazardous: they, and no shorter ones, answer for 1 s."""
    envelope = envelope_of(line)
    shorter = max(duration for duration in envelope.durations_s if duration < 1.0)
    assert (envelope.largest_survived(shorter) or 0) == 50.0
    assert (envelope.largest_survived(1.0) or 0) < 5
    assert envelope.largest_survived(envelope.durations_s[-1] + 1) is None


@pytest.mark.parametrize("magnitude", [-1.0, None, 51.0])
def test_another_sign_or_kind_is_unknown(magnitude: float | None) -> None:
    """A plane of positive magnitudes says nothing of negative ones, nor of a fault without a value."""
    assert envelope_of(never).state_at(magnitude, 1.0) is CellState.UNKNOWN


def test_negative_magnitudes_are_found_by_size() -> None:
    """The cell that is at least as large: -5 m answers for -4.9 m."""
    plane = replace(MADE_PLANE, magnitudes=[-value for value in MADE_PLANE.magnitudes])
    envelope = envelope_of(line, plane)
    assert not envelope.survives(-50.0, 10.0) and envelope.survives(-0.5, 10.0)
    assert envelope.state_at(0.5, 10.0) is CellState.UNKNOWN


def test_only_durations_that_can_be_observed_count() -> None:
    """A drive that ends 16 s after the fault's start decides durations of up to a second."""
    drive = Drive(start_s=5.0, end_s=21.0, step_s=STEP_S)
    envelope = envelope_of(never, drive=drive)
    assert envelope.longest_tried_s <= 1.0 < envelope.durations_s[envelope.columns_up_to()]
    assert envelope.largest_survived() == 50.0


def test_a_hazard_of_a_longer_fault_counts() -> None:
    """Also if the drive leaves no time to observe what follows faults of that duration."""
    drive = Drive(start_s=5.0, end_s=21.0, step_s=STEP_S)
    envelope = envelope_of(lambda m, d: 2.0 if m >= 5 and d >= 9 else None, drive=drive)
    assert (envelope.largest_survived() or 0) < 5.0 < (envelope.largest_survived(0.5) or 0)
