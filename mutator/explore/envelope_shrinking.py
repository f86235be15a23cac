"""The smallest form of a fault with the same hazard, read from envelopes of the fault.

An envelope has most of the answer: a driven or inferred cell with the hazard, whose next smaller and next
shorter neighbours have none. At most these three cells are driven, if they were not before.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from mutator.explore.cell_results import CellState, judge_cell
from mutator.explore.envelope import Envelope
from mutator.explore.fault_forms import Axis
from mutator.explore.lattice import Cell
from mutator.explore.plane_map import PlaneMap
from mutator.model import Outcome, Record

MOST_RUNS = 3  # the cell and its two neighbours; more only if nothing else is left


class EnvelopeCell(NamedTuple):
    """A cell of one of several envelopes."""

    envelope: int
    cell: Cell


class EnvelopeShrinking:
    """Looks for the smallest cell with the hazard of an experiment, which is `largest` in the last one of the
    envelopes. All have the same fault and lattice; the simplest scenario comes first.

    `records` are those of the runs in the envelopes.
    """

    def __init__(
        self, envelopes: Sequence[Envelope], largest: Cell, hazard: str, records: Mapping[str, Record]
    ) -> None:
        self._envelopes, self._largest, self._hazard = envelopes, largest, hazard
        self._records = dict(records)
        maps = [envelope.exploration.map for envelope in envelopes]
        self._maps = [PlaneMap(m.lattice, dict(m.results), dict(m.inferring)) for m in maps]
        self.runs = 0  # cells that were driven for this

    @property
    def smallest(self) -> EnvelopeCell:
        """The smallest cell, as far as the runs say: final once nothing is `undriven`.

        It is in the simplest scenario, and has the fewest neighbours of which nothing says that they are
        without hazard; of several such, the smallest one, and then the shortest.
        """
        candidates = [place for place in self._hazardous_cells() if not self._has_hazardous_neighbour(place)]
        remaining = MOST_RUNS - self.runs
        affordable = [place for place in candidates if len(self._undriven(place)) <= remaining]
        return min(
            affordable or candidates, key=lambda place: (place.envelope, self._doubts(place), place.cell)
        )

    @property
    def undriven(self) -> list[EnvelopeCell]:
        """What to drive next: the smallest cell and its neighbours, as far as they were not driven."""
        return self._undriven(self.smallest)

    def note(self, place: EnvelopeCell, record: Record) -> None:
        """Take the record of an undriven cell."""
        self.runs += 1
        self._records[record.experiment_id] = record
        plane_map, exploration = self._maps[place.envelope], self._envelopes[place.envelope].exploration
        duration_s = plane_map.lattice.durations_s[place.cell[1]]
        observe_s = exploration.section.observe_s
        plane_map.add(place.cell, judge_cell(record, duration_s, exploration.drive, observe_s))

    def neighbours(self, place: EnvelopeCell) -> dict[Axis, EnvelopeCell]:
        """Return the next shorter and the next smaller cell, as far as the lattice has them."""
        line, duration = place.cell
        smaller = {Axis.DURATION: (line, duration - 1), Axis.SIZE: (line - 1, duration)}
        return {axis: EnvelopeCell(place.envelope, cell) for axis, cell in smaller.items() if min(cell) >= 0}

    def record(self, place: EnvelopeCell) -> Record:
        """Return the record of a driven cell."""
        return self._records[self._maps[place.envelope].results[place.cell].experiment_id]

    def _hazardous_cells(self) -> Iterator[EnvelopeCell]:
        lines, durations = self._largest
        for number in range(len(self._envelopes)):
            for line in range(lines + 1):
                for duration in range(durations + 1):
                    if self._has_hazard(place := EnvelopeCell(number, (line, duration))):
                        yield place

    def _has_hazard(self, place: EnvelopeCell) -> bool:
        """Whether a cell was driven to the hazard, or must reach it because a shorter fault did."""
        plane_map = self._maps[place.envelope]
        if plane_map.state(place.cell) is CellState.INFERRED:
            proof = plane_map.proof_of(place.cell)
            return proof is not None and proof.hazard == self._hazard
        if place.cell not in plane_map.results:
            return False
        record = self.record(place)
        return record.outcome is Outcome.HAZARD and self._hazard in dict(record.hazards)

    def _has_hazardous_neighbour(self, place: EnvelopeCell) -> bool:
        return any(map(self._has_hazard, self.neighbours(place).values()))

    def _doubts(self, place: EnvelopeCell) -> int:
        """Return how many neighbours were not driven, and are not called without hazard."""
        cells, results = self._envelopes[place.envelope].cells, self._maps[place.envelope].results
        undriven = (n.cell for n in self.neighbours(place).values() if n.cell not in results)
        return sum(not cells[line][duration].is_without_hazard for line, duration in undriven)

    def _undriven(self, place: EnvelopeCell) -> list[EnvelopeCell]:
        results = self._maps[place.envelope].results
        return [other for other in (place, *self.neighbours(place).values()) if other.cell not in results]
