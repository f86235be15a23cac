"""An exploration: which experiments of which planes come in which batch, from the results of earlier ones."""

from collections import deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple, Protocol

from mutator.campaigns.exploration_section import ExplorationSection
from mutator.explore.cell_results import Drive, judge_cell
from mutator.explore.lattice import Cell
from mutator.explore.plane_exploration import PlaneExploration
from mutator.model import Record

BATCHES_IN_FLIGHT = (
    2  # so workers need not wait for proposals: a batch sees the results up to the last but one
)


def reason_of_batch(number: int) -> str:
    """Return the reason that the plan keeps with a batch."""
    return f"exploration, batch {number}"


class Proposal(NamedTuple):
    """A cell to drive. `plane` is the number of its plane, `form` as in `FormOfCell`."""

    plane: int
    cell: Cell
    form: str = ""


@dataclass(slots=True)
class Exploration:
    """The planes of an exploration, each with its drive. `seed` decides what validations draw."""

    section: ExplorationSection
    drives: Sequence[Drive]
    seed: int
    planes: list[PlaneExploration] = field(init=False)
    _next_plane: int = 0

    def __post_init__(self) -> None:
        self.planes = [
            PlaneExploration(plane=plane, drive=drive, section=self.section, seed=self.seed, number=number)
            for number, (plane, drive) in enumerate(zip(self.section.planes, self.drives, strict=True))
        ]

    def propose(self) -> list[Proposal]:
        """Return the next batch: a share for each plane that proposes anything, in turn."""
        batch: list[Proposal] = []
        order = [*self.planes[self._next_plane :], *self.planes[: self._next_plane]]
        share = max(1, self.section.batch // len(order))
        while len(batch) < self.section.batch:
            before = len(batch)
            for plane in order:
                most = min(share, self.section.batch - len(batch))
                batch += (Proposal(plane.number, *form) for form in plane.propose(most))
                if len(batch) >= self.section.batch:
                    self._next_plane = (plane.number + 1) % len(order)
                    break
            if len(batch) == before:
                break
        return batch

    def note(self, proposal: Proposal, record: Record) -> None:
        """Take the record of a proposed experiment."""
        plane = self.planes[proposal.plane]
        duration_s = plane.map.lattice.durations_s[proposal.cell[1]]
        result = judge_cell(record, duration_s, plane.drive, self.section.observe_s)
        plane.note(proposal.cell, result, proposal.form)


class BatchProposer(Protocol):
    """Proposes batches, each from the records of earlier ones."""

    @property
    def section(self) -> ExplorationSection: ...
    @property
    def drives(self) -> Sequence[Drive]: ...
    def propose(self) -> list[Proposal]: ...
    def note(self, proposal: Proposal, record: Record) -> None: ...


@dataclass(slots=True)
class BatchLoop:
    """Keeps batches of an exploration in flight.

    `begin` is called with the number and the proposals of a batch, if `may_begin` accepts these; `finish`
    returns its records, in order.
    """

    exploration: BatchProposer
    begin: Callable[[int, Sequence[Proposal]], None]
    finish: Callable[[Sequence[Proposal]], Iterable[Record]]
    may_begin: Callable[[Sequence[Proposal]], bool] = lambda batch: True

    def run(self) -> None:
        """Run until nothing is proposed, or until `may_begin` says no."""
        in_flight: deque[list[Proposal]] = deque()
        number, is_ending = 0, False
        while True:
            while len(in_flight) < BATCHES_IN_FLIGHT and not is_ending:
                if not (batch := self.exploration.propose()):
                    break
                if is_ending := not self.may_begin(batch):  # what was proposed is not proposed again
                    break
                number += 1
                self.begin(number, batch)
                in_flight.append(batch)
            if not in_flight:
                return
            batch = in_flight.popleft()
            for proposal, record in zip(batch, self.finish(batch), strict=True):
                self.exploration.note(proposal, record)
