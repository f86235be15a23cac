"""The smallest cell in envelopes of made-up planes."""

from collections.abc import Sequence
from dataclasses import replace

import pytest

from mutator.explore.envelope import Envelope
from mutator.explore.envelope_shrinking import MOST_RUNS, EnvelopeCell, EnvelopeShrinking
from mutator.explore.lattice import Cell
from mutator.model import Outcome, Record
from tests.unit.mutator.explore.made_envelopes import DRIVE, envelope_of, line, never
from tests.unit.mutator.explore.made_planes import Truth
from tests.unit.mutator.explore.test_cell_results import record


def record_of(truth: Truth, envelope: Envelope, cell: Cell) -> Record:
    time_s = truth(envelope.magnitudes[cell[0]] or 0.0, envelope.durations_s[cell[1]])
    hazards = () if time_s is None else (("H1", DRIVE.start_s + time_s),)
    outcome = Outcome.HAZARD if hazards else Outcome.MASKED
    return replace(record(outcome, hazards), experiment_id=str(cell))


def named(envelope: Envelope) -> Envelope:
    """Give the experiments of an envelope other ids than those of the others."""
    results = envelope.exploration.map.results
    for cell, result in results.items():
        results[cell] = replace(result, experiment_id=f"other {result.experiment_id}")
    return envelope


def shrink(truths: Sequence[Truth], envelopes: Sequence[Envelope]) -> tuple[EnvelopeShrinking, EnvelopeCell]:
    """Shrink the largest cell that was driven to a hazard in the last envelope."""
    results = envelopes[-1].exploration.map.results
    largest = max(cell for cell, result in results.items() if result.hazard)
    records = {
        result.experiment_id: replace(record_of(truth, envelope, cell), experiment_id=result.experiment_id)
        for truth, envelope in zip(truths, envelopes, strict=True)
        for cell, result in envelope.exploration.map.results.items()
    }
    shrinking = EnvelopeShrinking(envelopes, largest, "H1", records)
    while undriven := shrinking.undriven:
        for place in undriven:
            truth, envelope = truths[place.envelope], envelopes[place.envelope]
            shrinking.note(place, record_of(truth, envelope, place.cell))
    return shrinking, shrinking.smallest


@pytest.mark.parametrize(
    "truth",
    [
        line,
        lambda m, d: 0.6 if m >= 5 and d >= 0.3 else None,
        lambda m, d: 8 / m + 0.5 if m * d >= 8 else None,
        lambda m, d: 4.5 if m >= 5 and 1.0 <= d < 4.0 else None,
        lambda m, d: 0.05,
    ],
)
def test_the_smallest_cell_is_next_to_cells_without_the_hazard(truth: Truth) -> None:
    """At most three runs, because the envelope has the rest."""
    envelope = envelope_of(truth)
    shrinking, smallest = shrink([truth], [envelope])
    assert shrinking.runs <= MOST_RUNS
    for place in (smallest, *shrinking.neighbours(smallest).values()):
        i, j = place.cell
        reaches = truth(envelope.magnitudes[i] or 0.0, envelope.durations_s[j]) is not None
        assert reaches is (place == smallest)
        assert reaches is bool(shrinking.record(place).hazards)


def test_an_envelope_of_a_simpler_scenario_comes_first() -> None:
    """If it has the hazard; if not, the experiment's own has."""
    envelope = envelope_of(line)
    assert shrink([line, line], [named(envelope_of(line)), envelope])[1].envelope == 0
    assert shrink([never, line], [named(envelope_of(never)), envelope])[1].envelope == 1


def test_a_neighbour_that_turns_out_hazardous_is_no_neighbour() -> None:
    """An envelope can be wrong between its runs: the smallest cell is then another one."""
    envelope = envelope_of(line)
    _, smallest = shrink([line], [envelope])
    (i, j) = smallest.cell

    def truth(magnitude: float, duration_s: float) -> float | None:
        is_neighbour = (magnitude, duration_s) == (envelope.magnitudes[i - 1], envelope.durations_s[j])
        return 2.0 if is_neighbour else line(magnitude, duration_s)

    shrinking, other = shrink([truth], [envelope])
    for place in shrinking.neighbours(other).values():
        assert not shrinking.record(place).hazards
