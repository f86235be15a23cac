"""Envelopes of two runs over each other."""

from dataclasses import replace

from mutator.comparison.envelope_changes import compare_envelopes
from mutator.comparison.envelope_pictures import draw_envelope_changes
from tests.unit.mutator.explore.made_envelopes import MADE_PLANE, envelope_of, line, never


def test_what_got_smaller_comes_first() -> None:
    """With the run that shows it; a plane with other durations cannot be drawn over the first."""
    other, third = replace(MADE_PLANE, start="7"), replace(MADE_PLANE, start="8")
    shorter = replace(third, durations_s=third.durations_s[:-1])
    before = [envelope_of(line), envelope_of(never, other), envelope_of(line, third)]
    after = [envelope_of(line), envelope_of(line, other), envelope_of(line, shorter)]
    changes = compare_envelopes((before, after))
    smaller, same = draw_envelope_changes(changes)
    assert smaller.evidence_id and not same.evidence_id
    assert smaller.name.endswith("from 7 s") and " became hazardous" in smaller.text
    assert "<svg" in smaller.drawing and "from 7 s" in smaller.drawing
