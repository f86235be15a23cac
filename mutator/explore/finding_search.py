"""Searches all planes together for hazardous faults that are small and short.

The strategy `planes` goes on in breadth, to the largest and longest fault of a plane that was not driven yet,
and in depth, towards smaller and shorter faults of a plane with a hazard. It is a function of the results.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from math import prod

from mutator._common.random_streams import random_generator
from mutator.campaigns.exploration_section import ExplorationSection
from mutator.explore.cell_results import CellResult, CellState, Drive, judge_cell
from mutator.explore.exploration import Proposal
from mutator.explore.lattice import Cell, Lattice
from mutator.explore.plane_map import PlaneMap
from mutator.model import Record

RANDOM = "random"
_BREADTH_SHARE = 4  # of this many proposals, one is in depth


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """A hazard of one fault in one scenario from one start on, with the smallest fault that reached it.

    `plane` is the number of the plane. `cell` has the least product of magnitude and duration.
    """

    plane: int  #: the number of the plane
    hazard: str  #: the hazard
    cell: Cell  #: the numbers of magnitude and duration
    result: CellResult  #: the experiment, and when the hazard came


@dataclass(slots=True)
class FindingSearch:
    """The search of an exploration with the goal `find`. `seed` decides what the strategy `random` draws."""

    section: ExplorationSection
    drives: Sequence[Drive]
    seed: int
    planes: list[PlaneMap] = field(init=False)
    _proposed: dict[Proposal, None] = field(default_factory=dict)  # in their order
    _draws: int = 0  # of the strategy `random`, with those of cells that came before
    _begun: set[int] = field(default_factory=set)  # planes that were proposed, and those with a hazard
    _hazardous: set[int] = field(default_factory=set)

    def __post_init__(self) -> None:
        self.planes = [
            PlaneMap(
                Lattice(magnitudes=tuple(plane.magnitudes) or (None,), durations_s=tuple(plane.durations_s))
            )
            for plane in self.section.planes
        ]

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
        result = judge_cell(record, duration_s, drive, self.section.observe_s)
        plane.add(proposal.cell, result)
        if result.state is CellState.HAZARDOUS:
            self._hazardous.add(proposal.plane)

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
        chosen: list[Proposal] = []
        while len(chosen) < count:
            is_depth_first = (len(self._proposed) + len(chosen)) % _BREADTH_SHARE == _BREADTH_SHARE - 1
            proposal = (is_depth_first and self._next_in_depth(chosen)) or self._next_in_breadth()
            proposal = proposal or self._next_in_depth(chosen)
            if not proposal:
                break
            chosen.append(proposal)
            self._begun.add(proposal.plane)
        return chosen

    def _next_in_breadth(self) -> Proposal | None:
        """Return the largest cell of the most promising plane that was not driven: its fault and its scenario
        led to hazards in others, or were rarely tried.
        """
        tried = Counter(trait for number in self._begun for trait in self._traits(number))
        hazardous = Counter(trait for number in self._hazardous for trait in self._traits(number))

        def promise(number: int) -> float:
            return prod((hazardous[trait] + 1) / (tried[trait] + 2) for trait in self._traits(number))

        new = (number for number in range(len(self.planes)) if number not in self._begun)
        best = min(new, key=lambda number: (-promise(number), number), default=None)
        return None if best is None else Proposal(best, self.planes[best].lattice.largest)

    def _traits(self, number: int) -> tuple[tuple[str, str], ...]:
        plane = self.section.planes[number]
        return ("fault", plane.spec), ("scenario", plane.scenario)

    def _next_in_depth(self, chosen: Sequence[Proposal]) -> Proposal | None:
        """Return a smaller or shorter cell of a plane with a hazard, the one with the fewest runs first."""
        for number in sorted(self._hazardous, key=lambda number: (len(self.planes[number].results), number)):
            proposals = (Proposal(number, cell) for cell in smaller_cells(self.planes[number]))
            new = (p for p in proposals if p not in self._proposed and p not in chosen)
            if proposal := next(new, None):
                return proposal
        return None


def smaller_cells(plane: PlaneMap) -> Iterator[Cell]:
    """Yield the cells that come next towards the smallest and shortest hazardous fault of a plane.

    On three paths, half the way from the smallest hazardous cell to the largest one that is not: with the
    longest duration, with the largest magnitude, and with the smallest magnitude that is hazardous so far.
    """
    last_line, last_duration = plane.lattice.largest
    smallest = min(
        (line for (line, _), result in plane.results.items() if result.state is CellState.HAZARDOUS),
        default=last_line,
    )
    paths = (
        [(line, last_duration) for line in range(last_line + 1)],
        [(last_line, duration) for duration in range(last_duration + 1)],
        [(smallest, duration) for duration in range(last_duration + 1)],
    )
    for path in paths:
        states = [plane.state(cell) for cell in path]
        first = next((n for n, state in enumerate(states) if state and state.is_hazardous), len(path))
        below = max((n for n in range(first) if states[n] is not None), default=-1)
        if first - below > 1 and first < len(path):
            yield path[(first + below) // 2]


def _findings_of(number: int, plane: PlaneMap) -> Iterator[Finding]:
    best: dict[str, tuple[float, Cell, CellResult]] = {}
    for cell, result in sorted(plane.results.items()):
        if result.state is CellState.HAZARDOUS:
            magnitude = plane.lattice.magnitudes[cell[0]]
            size = abs(magnitude or 1.0) * plane.lattice.durations_s[cell[1]]
            if result.hazard not in best or size < best[result.hazard][0]:
                best[result.hazard] = size, cell, result
    for hazard, (_, cell, result) in sorted(best.items()):
        yield Finding(plane=number, hazard=hazard, cell=cell, result=result)


def dominated_share(plane: PlaneMap) -> float:
    """Return the share of a plane's cells that are at least as large and long as a hazardous one: the nearer
    to 1, the smaller and shorter the faults.
    """
    lines, durations = plane.lattice.largest
    corners = [cell for cell, result in plane.results.items() if result.state is CellState.HAZARDOUS]
    dominated = sum(
        any(i <= line and j <= duration for i, j in corners)
        for line in range(lines + 1)
        for duration in range(durations + 1)
    )
    return dominated / plane.lattice.size
