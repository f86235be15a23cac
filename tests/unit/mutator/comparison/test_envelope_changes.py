"""Envelopes of two runs: which got smaller."""

from dataclasses import replace

from mutator.comparison.envelope_changes import (
    compare_envelopes,
    describe_envelope_changes,
    envelopes_sheet,
    planes_only_in,
    remarks_on_planes,
)
from mutator.comparison.paired_rate_and_time_sheets import RunDisplayNames
from tests.unit.mutator.explore.made_envelopes import MADE_PLANE, envelope_of, line, never

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
    assert sheet.lines[0][-3:] == ("3.41 m", "3.41 m", "no")


def test_cells_that_a_run_does_not_decide_do_not_count() -> None:
    """Only cells of which both runs say something are compared."""
    [change] = compare_envelopes(([envelope_of(never)], [envelope_of(line, most_runs=4)]))
    assert change.decided < envelope_of(line).exploration.map.lattice.size


def test_planes_of_one_run_are_named() -> None:
    """Another scenario, or another sign, is another plane."""
    negative = replace(MADE_PLANE, magnitudes=[-value for value in MADE_PLANE.magnitudes])
    a, b = [envelope_of(never)], [envelope_of(never, negative)]
    assert planes_only_in(a, b) == a and compare_envelopes((a, b)) == ()
    assert list(remarks_on_planes((a, b), NAMES)) == [
        "Only before has explored: sensor/bias/distance in A from 5 s.",
        "Only after has explored: sensor/bias/distance (negative) in A from 5 s.",
    ]
