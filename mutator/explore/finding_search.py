"""Searches all planes together for hazardous faults that are small and short.

The strategy `planes` drives the cell with the largest expected gain: the chance of a hazard, as planes of the
same fault, scenario and start let expect it, times what the hazard would add, a first finding and the share
of the plane's cells that are as large and long. Of equal ones, the plane comes first whose golden run is more
critical at the start. It is a function of golden runs and results.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from mutator._common.random_streams import random_generator
from mutator.campaigns.exploration_section import ExplorationSection, ExploredPlane
from mutator.explore.cell_results import CellResult, CellState, Drive, judge_cell
from mutator.explore.exploration import Proposal
from mutator.explore.finding_gains import FaultShape, PlaneGains
from mutator.explore.lattice import Cell, Lattice
from mutator.explore.plane_map import PlaneMap
from mutator.model import Record

RANDOM = "random"


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """A hazard of one fault in one scenario from one start on, with the smallest fault that reached it.

    `plane` is the number of the plane. `cell` has the least product of magnitude and duration. It was driven,
    or follows from a longer fault that reached the hazard while it was active.
    """

    plane: int  #: the number of the plane
    hazard: str  #: the hazard
    cell: Cell  #: the numbers of magnitude and duration
    result: CellResult  #: the experiment that shows it, and when the hazard came
    is_inferred: bool = False  #: whether the experiment's fault lasted longer


@dataclass(slots=True)
class FindingSearch:
    """The search of an exploration with the goal `find`. `seed` decides what the strategy `random` draws."""

    section: ExplorationSection
    drives: Sequence[Drive]
    seed: int
    planes: list[PlaneMap] = field(init=False)
    _proposed: dict[Proposal, None] = field(default_factory=dict)  # in their order
    _draws: int = 0  # of the strategy `random`, with those of cells that came before
    _ranking: "_PlaneRanking" = field(init=False)

    def __post_init__(self) -> None:
        self.planes = [
            PlaneMap(
                Lattice(magnitudes=tuple(plane.magnitudes) or (None,), durations_s=tuple(plane.durations_s))
            )
            for plane in self.section.planes
        ]
        lattices = [plane.lattice for plane in self.planes]
        self._ranking = _PlaneRanking(self.section, lattices, self.drives)

    def propose(self) -> list[Proposal]:
        """Return the next batch; empty once the budget is spent or nothing is left to drive."""
        count = min(self.section.batch, self.section.budget - len(self._proposed))
        proposals = self._draw(count) if self.section.strategy == RANDOM else self._choose(count)
        self._proposed |= dict.fromkeys(proposals)
        return proposals

    def note(self, proposal: Proposal, record: Record) -> None:
        """Take the record of a proposed experiment."""
        plane, drive = self.planes[proposal.plane], self.drives[proposal.plane]
        duration_s = plane.lattice.durations_s[proposal.cell[1]]
        plane.add(proposal.cell, judge_cell(record, duration_s, drive, self.section.observe_s))
        self._ranking.note(proposal, _first_hazardous(plane, proposal.cell))

    def finding_counts(self) -> list[int]:
        """Return the number of findings after each run, in the order in which they were proposed."""
        reached, counts = set[tuple[int, str]](), list[int]()
        for proposal in self._proposed:
            if (result := self.planes[proposal.plane].results.get(proposal.cell)) is not None:
                if result.state is CellState.HAZARDOUS:
                    reached.add((proposal.plane, result.hazard))
                counts.append(len(reached))
        return counts

    def findings(self) -> list[Finding]:
        """Return a finding for each plane and hazard, in the order of the planes."""
        return [
            finding for number, plane in enumerate(self.planes) for finding in _findings_of(number, plane)
        ]

    def _draw(self, count: int) -> list[Proposal]:
        """Draw new proposals; fewer than `count` if few cells are left."""
        drawn: list[Proposal] = []
        cell_count = sum(plane.lattice.size for plane in self.planes)
        while len(drawn) < count and len(self._proposed) + len(drawn) < cell_count:
            proposal = self._drawn_proposal(self._draws)
            self._draws += 1
            if proposal not in self._proposed and proposal not in drawn:
                drawn.append(proposal)
        return drawn

    def _drawn_proposal(self, number: int) -> Proposal:
        generator = random_generator(self.seed, f"explore/find/{number}")
        plane = int(generator.integers(len(self.planes)))
        lattice = self.planes[plane].lattice
        line = int(generator.integers(len(lattice.magnitudes)))
        return Proposal(plane, (line, int(generator.integers(len(lattice.durations_s)))))

    def _choose(self, count: int) -> list[Proposal]:
        proposals = (self._ranking.next_proposal() for _ in range(count))
        return [proposal for proposal in proposals if proposal]


class _PlaneRanking:
    """Which plane, and which of its cells, promises most. What results change is computed when they come."""

    def __init__(
        self, section: ExplorationSection, lattices: Sequence[Lattice], drives: Sequence[Drive]
    ) -> None:
        planes = section.planes
        # The order among planes that promise the same. A plane that was never driven has no golden run when
        # a run is replayed, and comes last: that changes nothing for the others.
        self._order = np.argsort([drive.time_margin_ms for drive in drives], kind="stable")
        self._shapes: dict[tuple[str, Lattice], FaultShape] = {}
        self._keys = [(plane.spec, lattice) for plane, lattice in zip(planes, lattices, strict=True)]
        self._numbers_by_key: dict[tuple[str, Lattice], list[int]] = {}
        for number, key in enumerate(self._keys):
            self._numbers_by_key.setdefault(key, []).append(number)
            self._shapes.setdefault(key, FaultShape(key[1]))
        traits = [_trait_numbers(values) for values in zip(*map(_traits_of, planes), strict=True)]
        self._traits = np.array(traits)  # of each kind, for each plane
        self._tried, self._hazardous = (
            np.zeros((len(traits), 1 + self._traits.max()), dtype=int) for _ in range(2)
        )
        self._gains: dict[int, PlaneGains] = {}  # of planes that were begun
        self._gain_values = np.zeros(len(planes))  # for new planes, if they had a hazard for sure
        self._cells: list[Cell] = [(0, 0)] * len(planes)
        self._is_new = np.ones(len(planes), dtype=bool)
        for key in self._shapes:
            self._rank_new(key)

    def next_proposal(self) -> Proposal | None:
        """Return what to drive next; None if all cells were driven or inferred."""
        scores = np.where(self._is_new, self._gain_values * self._promises(), self._gain_values)
        number = int(self._order[scores[self._order].argmax()])
        proposal = Proposal(number, self._cells[number]) if scores[number] > 0 else self._spare_proposal()
        if proposal:
            self._begin(proposal)
        return proposal

    def note(self, proposal: Proposal, first_hazardous: int | None) -> None:
        """Take a result: the first hazardous duration of the cell's line that follows from it, None if it had
        no hazard.
        """
        number, cell = proposal.plane, proposal.cell
        key = self._keys[number]
        gains = self._gains.get(number)
        if gains is None:  # drawn by chance
            return
        had_hazard = gains.has_hazard
        self._shapes[key].count(gains, -1)
        gains.note(cell, first_hazardous)
        self._shapes[key].count(gains, 1)
        if gains.has_hazard and not had_hazard:
            self._hazardous[np.arange(len(self._traits)), self._traits[:, number]] += 1
        self._rank(number)
        if gains.has_hazard:
            self._rank_new(key)

    def _promises(self, numbers: slice | int = slice(None)) -> np.ndarray:
        """Return for planes, by default all, the estimated chance that they have a hazard."""
        shares = (self._hazardous + 1) / (self._tried + 2)
        promises = np.ones(())
        for share, trait_numbers in zip(shares, self._traits, strict=True):
            promises = promises * share[trait_numbers[numbers]]
        return promises

    def _begin(self, proposal: Proposal) -> None:
        number, cell = proposal.plane, proposal.cell
        if number not in self._gains:
            self._gains[number] = PlaneGains(self._keys[number][1])
            self._is_new[number] = False
            self._tried[np.arange(len(self._traits)), self._traits[:, number]] += 1
        self._gains[number].awaited.add(cell)
        self._rank(number)

    def _rank(self, number: int) -> None:
        chances = self._shapes[self._keys[number]].chances()
        promise = 1.0 if self._gains[number].has_hazard else float(self._promises(number))
        self._gain_values[number], self._cells[number] = self._gains[number].best(chances, promise)

    def _rank_new(self, key: tuple[str, Lattice]) -> None:
        gain, cell = PlaneGains(key[1]).best(self._shapes[key].chances(), 1.0)
        for number in self._numbers_by_key[key]:
            if self._is_new[number]:
                self._gain_values[number], self._cells[number] = gain, cell

    def _spare_proposal(self) -> Proposal | None:
        """Return a cell of which nothing is expected, in the plane with the fewest cells that were driven."""
        for number in sorted(self._gains, key=lambda n: (int(self._gains[n].is_driven.sum()), n)):
            if cell := self._gains[number].spare_cell():
                return Proposal(number, cell)
        return None


def _traits_of(plane: ExploredPlane) -> tuple[str, ...]:
    return plane.spec, plane.scenario, plane.start


def _trait_numbers(values: Iterable[str]) -> list[int]:
    numbers: dict[str, int] = {}
    return [numbers.setdefault(value, len(numbers)) for value in values]


def _first_hazardous(plane: PlaneMap, cell: Cell) -> int | None:
    """Return the first duration of a cell's line that its result shows to be hazardous; None without one."""
    result = plane.results[cell]
    if result.state is not CellState.HAZARDOUS:
        return None
    if result.inferred_from_s is None:
        return cell[1]
    return next(j for j, d in enumerate(plane.lattice.durations_s) if d >= result.inferred_from_s)


def _findings_of(number: int, plane: PlaneMap) -> Iterator[Finding]:
    best: dict[str, tuple[float, Finding]] = {}
    for cell, result in sorted(plane.results.items()):
        line, duration = cell
        first = _first_hazardous(plane, cell)
        if first is None:
            continue
        size = abs(plane.lattice.magnitudes[line] or 1.0) * plane.lattice.durations_s[first]
        if result.hazard not in best or size < best[result.hazard][0]:
            best[result.hazard] = (
                size,
                Finding(
                    plane=number,
                    hazard=result.hazard,
                    cell=(line, first),
                    result=result,
                    is_inferred=first < duration,
                ),
            )
    for _, (_, finding) in sorted(best.items()):
        yield finding


def dominated_share(plane: PlaneMap) -> float:
    """Return the share of a plane's cells that are at least as large and long as a hazardous one, driven or
    inferred: the nearer to 1, the smaller and shorter the faults.
    """
    is_dominated = np.zeros((len(plane.lattice.magnitudes), len(plane.lattice.durations_s)), dtype=bool)
    for cell in plane.results:
        first = _first_hazardous(plane, cell)
        if first is not None:
            is_dominated[cell[0] :, first:] = True
    return int(is_dominated.sum()) / plane.lattice.size
