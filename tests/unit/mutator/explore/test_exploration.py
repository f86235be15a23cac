"""Batches of an exploration depend on earlier results alone."""

from collections.abc import Sequence
from itertools import count

import pytest

from mutator.campaigns.exploration_section import ExplorationSection
from mutator.explore.cell_results import Drive
from mutator.explore.exploration import BATCHES_IN_FLIGHT, BatchLoop, Exploration, Proposal
from mutator.model import Outcome, Record, Status
from tests.unit.mutator.explore.made_planes import STEP_S, falling_curve
from tests.unit.mutator.explore.test_plane_exploration import PLANE

DRIVE = Drive(start_s=0.0, end_s=60.0, step_s=STEP_S)


def exploration(plane_count: int, batch: int = 16) -> Exploration:
    section = ExplorationSection(planes=[PLANE] * plane_count, batch=batch, validation=20)
    return Exploration(section=section, drives=[DRIVE] * plane_count, seed=1)


class MadeRuns:
    """Answers batches by made-up truths, a falling curve for each plane."""

    def __init__(self, explored: Exploration) -> None:
        self._explored = explored
        self.batches: list[list[Proposal]] = []
        self.in_flight: list[int] = []
        self._finished = 0

    def begin(self, number: int, batch: Sequence[Proposal]) -> None:
        self.batches.append(list(batch))
        assert number == len(self.batches)
        self.in_flight.append(len(self.batches) - self._finished)

    def finish(self, batch: Sequence[Proposal]) -> list[Record]:
        self._finished += 1
        return [self._record(proposal) for proposal in batch]

    def _record(self, proposal: Proposal) -> Record:
        lattice = self._explored.planes[proposal.plane].map.lattice
        line, duration = proposal.cell
        time_s = falling_curve(proposal.plane)(lattice.magnitudes[line] or 0.0, lattice.durations_s[duration])
        return Record(
            experiment_id=str(proposal),
            status=Status.OK,
            outcome=Outcome.SDC if time_s is None else Outcome.HAZARD,
            detail="",
            tree="",
            activation=None,
            t_manifest=None,
            max_dev=(),
            hazards=() if time_s is None else (("H1", time_s),),
            alerts=(),
            trace_digest="",
        )


def run_whole(plane_count: int, batch: int = 16) -> MadeRuns:
    explored = exploration(plane_count, batch)
    runs = MadeRuns(explored)
    BatchLoop(exploration=explored, begin=runs.begin, finish=runs.finish).run()
    return runs


def test_two_batches_are_in_flight() -> None:
    """So workers never wait for a proposal, and never more than two are proposed ahead."""
    assert set(run_whole(3).in_flight) == {1, BATCHES_IN_FLIGHT}


def test_the_same_batches_come_again() -> None:
    """Proposals are a function of results, so a repetition proposes the same cells in the same batches."""
    assert run_whole(3).batches == run_whole(3).batches


def test_planes_share_a_batch() -> None:
    """Each of four planes has cells in the first batch, and none waits for another to end."""
    first = run_whole(4).batches[0]
    assert {proposal.plane for proposal in first} == {0, 1, 2, 3} and len(first) <= 16


@pytest.mark.parametrize("plane_count", [1, 20])
def test_no_cell_comes_twice(plane_count: int) -> None:
    """Also with more planes than a batch has cells."""
    proposals = [proposal for batch in run_whole(plane_count).batches for proposal in batch]
    assert len(set(proposals)) == len(proposals)
    assert {proposal.plane for proposal in proposals} == set(range(plane_count))


def test_an_end_of_the_budget_is_a_prefix() -> None:
    """The clock decides how many batches there are, never what is in one."""
    explored, counter = exploration(2), count()
    runs = MadeRuns(explored)
    BatchLoop(
        exploration=explored, begin=runs.begin, finish=runs.finish, may_begin=lambda batch: next(counter) < 5
    ).run()
    whole = run_whole(2).batches
    assert 0 < len(runs.batches) < len(whole) and runs.batches == whole[: len(runs.batches)]
