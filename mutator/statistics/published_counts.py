"""Published counts of similar experiments, which tables show next to those of a run."""

from collections.abc import Mapping
from dataclasses import dataclass

from mutator.statistics.tallies import Tally

THIS_RUN = "here"  # label of a run's rows next to published rows
TallyByGroup = Mapping[tuple[str, str], Tally]


@dataclass(frozen=True, slots=True, kw_only=True)
class PublishedCounts:
    """Published counts by (method, scenario) and by (method, fault type), and texts for their tables.

    `source` labels the rows. Titles and notes are added to those of the tables. `driver_reaction_s` is the
    driver's reaction time that the publication assumes, in s.
    """

    source: str
    by_scenario: TallyByGroup
    by_fault_type: TallyByGroup
    scenario_title: str
    fault_type_title: str
    counts_note: str
    fault_type_note: str
    times_note: str
    driver_reaction_s: float


def counts_by_source(published: PublishedCounts | None, run_counts: TallyByGroup) -> dict[str, TallyByGroup]:
    return ({published.source: published.by_fault_type} if published else {}) | {THIS_RUN: run_counts}
