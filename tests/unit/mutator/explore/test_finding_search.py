"""The search for findings, on made-up planes."""

from collections.abc import Sequence
from dataclasses import replace

from mutator.campaigns.exploration_section import ExplorationSection
from mutator.explore.cell_results import Drive
from mutator.explore.exploration import BatchLoop, Proposal
from mutator.explore.finding_search import FindingSearch, dominated_share
from mutator.explore.lattice import durations_between, magnitudes_between
from mutator.model import Outcome, Record, Status
from tests.unit.mutator.explore.made_planes import STEP_S
from tests.unit.mutator.explore.test_plane_exploration import PLANE

MAGNITUDES = magnitudes_between(0.6, 60.0, 16)
DURATIONS = durations_between(STEP_S, 15.0, 9, STEP_S)
FAULTS, SCENARIOS = 12, 5
PLANES = [
    replace(
        PLANE, spec=f"fault/{f}/x", scenario=f"S{s}", magnitudes=list(MAGNITUDES), durations_s=list(DURATIONS)
    )
    for f in range(FAULTS)
    for s in range(SCENARIOS)
]


def is_hazardous(plane: int, magnitude: float, duration_s: float) -> bool:
    """A third of the faults is dangerous, in all scenarios but one, if they are large and long enough."""
    fault, scenario = divmod(plane, SCENARIOS)
    return fault % 3 == 0 and scenario != 4 and magnitude * duration_s >= 20.0 + 10.0 * scenario


def record_of(proposal: Proposal) -> Record:
    line, duration = proposal.cell
    hazardous = is_hazardous(proposal.plane, MAGNITUDES[line], DURATIONS[duration])
    return Record(
        experiment_id=str(proposal),
        status=Status.OK,
        outcome=Outcome.HAZARD if hazardous else Outcome.SDC,
        detail="",
        tree="",
        activation=None,
        t_manifest=None,
        max_dev=(),
        hazards=(("H1", 30.0),) if hazardous else (),
        alerts=(),
        trace_digest="",
    )


def searched(strategy: str, budget: int = 100) -> tuple[FindingSearch, list[list[Proposal]]]:
    section = ExplorationSection(planes=PLANES, goal="find", strategy=strategy, budget=budget)  # type: ignore[arg-type]
    drives = [Drive(start_s=0.0, end_s=60.0, step_s=STEP_S)] * len(PLANES)
    search = FindingSearch(section=section, drives=drives, seed=1)
    batches: list[list[Proposal]] = []

    def begin(number: int, batch: Sequence[Proposal]) -> None:
        batches.append(list(batch))

    BatchLoop(exploration=search, begin=begin, finish=lambda batch: map(record_of, batch)).run()
    return search, batches


def test_the_search_has_more_and_smaller_findings_than_chance() -> None:
    """With the same 100 runs of 60 planes, of which 16 have a hazard."""
    (planes, batches), (chance, _) = searched("planes"), searched("random")
    assert sum(map(len, batches)) == 100
    assert len(planes.findings()) == 16 >= 2 * len(chance.findings())
    assert sum(map(dominated_share, planes.planes)) > 1.5 * sum(map(dominated_share, chance.planes))


def test_the_same_search_comes_again() -> None:
    for strategy in ("planes", "random"):
        assert searched(strategy)[1] == searched(strategy)[1]


def test_no_cell_is_driven_twice() -> None:
    """Also if the budget is larger than what promises anything."""
    _, batches = searched("planes", budget=2_000)
    proposals = [proposal for batch in batches for proposal in batch]
    assert len(set(proposals)) == len(proposals) == 2_000


def test_chance_spends_its_budget() -> None:
    """Cells that are drawn again cost no run, and do not end the search before all cells were driven."""
    cell_count = sum(len(plane.magnitudes) * len(plane.durations_s) for plane in PLANES)
    _, batches = searched("random", budget=2_000)
    assert sum(map(len, batches)) == 2_000 < cell_count
    section = ExplorationSection(planes=PLANES[:1], goal="find", strategy="random", budget=1_000)
    search = FindingSearch(section=section, drives=[Drive(start_s=0.0, end_s=60.0, step_s=STEP_S)], seed=1)
    proposals = []
    while batch := search.propose():
        proposals += batch
    assert len(set(proposals)) == len(proposals) == len(MAGNITUDES) * len(DURATIONS)


def test_a_search_of_few_planes_spends_its_budget() -> None:
    """Also in cells of which nothing is expected, until all were driven: one plane has 144."""
    section = ExplorationSection(planes=PLANES[:1], goal="find", budget=1_000)
    search = FindingSearch(section=section, drives=[Drive(start_s=0.0, end_s=60.0, step_s=STEP_S)], seed=1)
    proposals = []
    while batch := search.propose():
        proposals += batch
        for proposal in batch:
            search.note(proposal, record_of(proposal))
    assert len(set(proposals)) == len(proposals) == len(MAGNITUDES) * len(DURATIONS)


def test_a_finding_is_the_smallest_fault_that_was_driven() -> None:
    """At the end of a long search, a fault of half its magnitude and duration has no hazard."""
    search, _ = searched("planes", budget=2_000)
    for finding in search.findings():
        line, duration = finding.cell
        assert is_hazardous(finding.plane, MAGNITUDES[line], DURATIONS[duration])
        assert not is_hazardous(finding.plane, MAGNITUDES[line] / 2, DURATIONS[duration] / 2)


def test_a_finding_is_inferred_where_causality_proves_it() -> None:
    """A fault of 15 s reached its hazard after 2 s, while it was active, so one of 2.02 s does, too. The
    finding is the shortest one of the lattice that is as long, and the driven experiment shows it.
    """
    search, _ = searched("planes", budget=0)
    record = replace(record_of(Proposal(0, (15, 8))), outcome=Outcome.HAZARD, hazards=(("H1", 2.0),))
    search.note(Proposal(0, (15, 8)), record)
    [finding] = search.findings()
    line, duration = finding.cell
    assert line == 15 and DURATIONS[duration - 1] < 2.02 <= DURATIONS[duration]
    assert finding.is_inferred and finding.result.experiment_id == record.experiment_id
    assert dominated_share(search.planes[0]) == (9 - duration) / (16 * 9)


def test_findings_are_counted_after_each_run() -> None:
    """The count never falls, has an entry for each run, and ends with all findings."""
    search, batches = searched("planes")
    counts = search.finding_counts()
    assert len(counts) == sum(map(len, batches)) and counts == sorted(counts)
    assert counts[-1] == len(search.findings()) > 0


def test_planes_that_promise_the_same_come_by_how_critical_their_golden_run_is() -> None:
    """The first batch has each fault, scenario and start that was not seen before, the most critical first.
    A plane without a golden run is last, and the others keep their order.
    """
    margins_ms = [3000 - 7 * (number * 37 % len(PLANES)) for number in range(len(PLANES))]
    drives = [Drive(start_s=0.0, end_s=60.0, step_s=STEP_S, time_margin_ms=ms) for ms in margins_ms]
    section = ExplorationSection(planes=PLANES, goal="find", batch=SCENARIOS)
    chosen = [p.plane for p in FindingSearch(section=section, drives=drives, seed=1).propose()]
    assert chosen[0] == margins_ms.index(min(margins_ms))
    assert [margins_ms[number] for number in chosen] == sorted(margins_ms[number] for number in chosen)
    assert {number % SCENARIOS for number in chosen} == set(range(SCENARIOS))
    assert len({number // SCENARIOS for number in chosen}) == SCENARIOS
    left_out = next(number for number in range(len(PLANES)) if number not in chosen)
    drives[left_out] = Drive(start_s=0.0, end_s=0.0, step_s=1.0)
    assert [p.plane for p in FindingSearch(section=section, drives=drives, seed=1).propose()] == chosen
