"""Envelopes of two runs: which got smaller."""

from dataclasses import replace

import pytest

from mutator.comparison.envelope_changes import (
    compare_envelopes,
    describe_envelope_changes,
    envelopes_sheet,
    planes_only_in,
    remarks_on_planes,
)
from mutator.comparison.paired_rate_and_time_sheets import RunDisplayNames
from mutator.explore.cell_results import CellState
from mutator.explore.envelope import Envelope
from tests.unit.mutator.explore.made_envelopes import DRIVE, MADE_PLANE, envelope_of, line, never

NAMES = RunDisplayNames(a="before", b="after")


def test_a_hazard_where_there_was_none_makes_an_envelope_smaller() -> None:
    """The cells that became hazardous are counted, and a run proves it; the reverse is no loss."""
    [change] = compare_envelopes(([envelope_of(never)], [envelope_of(line)]))
    assert change.is_smaller and 0 < change.became_hazardous <= change.decided and not change.became_safe
    [back] = compare_envelopes(([envelope_of(line)], [envelope_of(never)]))
    assert not back.is_smaller and back.became_safe > 0
    assert describe_envelope_changes([change, back]) == "Of 2 envelopes, 1 got smaller."


def test_equal_envelopes_have_no_change() -> None:
    """All decided cells agree."""
    [change] = compare_envelopes(([envelope_of(line)], [envelope_of(line)]))
    assert (change.became_hazardous, change.became_safe, change.is_smaller) == (0, 0, False)
    sheet = envelopes_sheet([change], NAMES)
    assert not change.mismatch
    assert sheet.lines[0][-3:] == ("3.41 m", "3.41 m", "no")


def test_cells_that_a_run_does_not_decide_do_not_count() -> None:
    """Only cells of which both runs say something are compared."""
    [change] = compare_envelopes(([envelope_of(never)], [envelope_of(line, most_runs=4)]))
    assert change.decided < envelope_of(line).exploration.map.lattice.size


def test_a_hazard_between_runs_makes_an_envelope_smaller() -> None:
    """Where no run proves what is called hazardous, the nearest run with a hazard is named."""
    before, after = envelope_of(never), envelope_of(lambda m, d: 30.0 if m >= 5 else None)
    between = [
        (i, j)
        for i, states in enumerate(after.cells)
        for j, state in enumerate(states)
        if state is CellState.BETWEEN_HAZARDOUS
    ]
    assert between
    for cell in after.exploration.map.results:  # without hazard was called only what lies between
        before.cells[cell[0]][cell[1]] = CellState.UNKNOWN
    [change] = compare_envelopes(([before], [after]))
    assert change.became_hazardous and change.is_smaller
    assert change.evidence and change.evidence.state is CellState.HAZARDOUS
    assert change.evidence.experiment_id.startswith(f"({between[0][0]},")


def test_crashes_make_an_envelope_smaller() -> None:
    """What was without hazard and is no longer decided is a loss, and a run without a result is named."""
    crashed = envelope_of(never, crashes=lambda m, d: m > 20)
    [change] = compare_envelopes(([envelope_of(never)], [crashed]))
    assert change.is_smaller and change.became_undecided and not change.became_hazardous
    assert change.evidence and change.evidence.state is CellState.NOT_DECIDED
    [unfinished] = compare_envelopes(([envelope_of(never)], [envelope_of(never, most_runs=20)]))
    assert unfinished.became_undecided and not unfinished.is_smaller


@pytest.mark.parametrize(
    ("other", "text"),
    [
        (envelope_of(never, replace(MADE_PLANE, magnitudes=MADE_PLANE.magnitudes[:9])), "magnitudes differ"),
        (envelope_of(never, replace(MADE_PLANE, durations_s=[0.1, 1.0])), "durations in s differ"),
        (envelope_of(never, drive=replace(DRIVE, start_s=6.0)), "starts in s differ (5 and 6)"),
        (envelope_of(never, observe_s=5.0), "observation times in s differ (15 and 5)"),
    ],
)
def test_unequal_planes_cannot_be_compared(other: Envelope, text: str) -> None:
    """Cells of other faults, starts or windows prove nothing."""
    [change] = compare_envelopes(([envelope_of(never)], [other]))
    assert text in change.mismatch


def test_planes_of_one_run_are_named() -> None:
    """Another scenario, or another sign, is another plane."""
    negative = replace(MADE_PLANE, magnitudes=[-value for value in MADE_PLANE.magnitudes])
    a, b = [envelope_of(never)], [envelope_of(never, negative)]
    assert planes_only_in(a, b) == a and compare_envelopes((a, b)) == ()
    assert list(remarks_on_planes((a, b), NAMES)) == [
        "Only before has explored: sensor/bias/distance in A from 5 s.",
        "Only after has explored: sensor/bias/distance (negative) in A from 5 s.",
    ]


def test_a_bound_that_challengers_lower_makes_an_envelope_smaller() -> None:
    """Of constant errors, nothing changes; the run is that of the challenger. Not in the other direction."""
    plane = replace(MADE_PLANE, challengers=("noise",))
    before, after = envelope_of(line, plane), envelope_of(line, plane, challengers=lambda name, m, d: m < 2)
    [change] = compare_envelopes(([before], [after]))
    assert change.is_smaller and change.became_hazardous == 0 and change.lowered_bounds > 0
    assert change.evidence and change.evidence.experiment_id.endswith("noise")
    assert "challengers lower" in change.text
    assert not compare_envelopes(([after], [before]))[0].is_smaller
    assert not compare_envelopes(([after], [after]))[0].is_smaller
