"""What it costs to propose an experiment of a search for findings among many planes.

`python benchmarks/proposing.py [--planes 10000] [--runs 1000]`. The planes are made up: a hundredth of them
has each fault, and a third of the faults is dangerous. Nothing is driven.
"""

import argparse
from collections import deque
from collections.abc import Sequence
from time import process_time

from mutator.campaigns.exploration_section import ExplorationSection, ExploredPlane
from mutator.explore.cell_results import Drive
from mutator.explore.exploration import BATCHES_IN_FLIGHT, Proposal
from mutator.explore.finding_search import FindingSearch
from mutator.explore.lattice import durations_between, magnitudes_between
from mutator.model import Outcome, Record, Status

STEP_S, GOAL_MS = 0.01, 1.0
MAGNITUDES = list(magnitudes_between(0.6, 60.0, 16))
DURATIONS_S = list(durations_between(STEP_S, 15.0, 9, STEP_S))


def made_up_planes(count: int) -> list[ExploredPlane]:
    return [
        ExploredPlane(
            spec=f"made/up/{number % 100}",
            scenario=f"S{number // 100}",
            start="0",
            condition="t >= 0",
            magnitudes=MAGNITUDES,
            durations_s=DURATIONS_S,
        )
        for number in range(count)
    ]


def record_of(proposal: Proposal) -> Record:
    line, duration = proposal.cell
    fault, scenario = proposal.plane % 100, proposal.plane // 100
    is_hazardous = fault % 3 == 0 and MAGNITUDES[line] * DURATIONS_S[duration] >= 20.0 + scenario
    return Record(
        experiment_id=str(proposal),
        status=Status.OK,
        outcome=Outcome.HAZARD if is_hazardous else Outcome.SDC,
        detail="",
        tree="",
        activation=None,
        t_manifest=None,
        max_dev=(),
        hazards=(("H1", 30.0),) if is_hazardous else (),
        alerts=(),
        trace_digest="",
    )


def propose_all(search: FindingSearch) -> tuple[int, float]:
    """Return the number of proposed experiments, and the CPU s for proposing and learning from them."""
    in_flight: deque[Sequence[Proposal]] = deque()
    count, used_s = 0, 0.0
    while True:
        begin_s = process_time()
        while len(in_flight) < BATCHES_IN_FLIGHT and (batch := search.propose()):
            in_flight.append(batch)
        used_s += process_time() - begin_s
        if not in_flight:
            return count, used_s
        batch = list(in_flight.popleft())
        records = list(map(record_of, batch))
        begin_s = process_time()
        for proposal, record in zip(batch, records, strict=True):
            search.note(proposal, record)
        used_s += process_time() - begin_s
        count += len(batch)


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--planes", type=int, default=10_000)
    parser.add_argument("--runs", type=int, default=1_000)
    options = parser.parse_args()
    section = ExplorationSection(planes=made_up_planes(options.planes), goal="find", budget=options.runs)
    drive = Drive(start_s=0.0, end_s=60.0, step_s=STEP_S)
    search = FindingSearch(section=section, drives=[drive] * options.planes, seed=1)
    count, used_s = propose_all(search)
    ms = 1e3 * used_s / count
    print(f"{options.planes:,} planes: {ms:.2f} ms an experiment, over the goal: {ms / GOAL_MS:.2f}")
    return int(ms > GOAL_MS)


if __name__ == "__main__":
    raise SystemExit(main())
