"""Published counts of similar experiments, which tables show next to those of a run."""

from collections.abc import Mapping
from dataclasses import dataclass

from mutator.statistics.tallies import Tally

OURS = "here"  # label of a run's rows next to published rows
Counts = Mapping[tuple[str, str], Tally]


@dataclass(frozen=True, slots=True, kw_only=True)
class Published:
    """Published counts by (method, scenario) and by (method, fault type), and texts for their tables.

    `source` labels the rows. Titles and notes are added to those of the tables. `driver_s` is the driver's
    reaction time that the publication assumes, in s.
    """

    source: str
    by_scenario: Counts
    by_kind: Counts
    scenario_title: str
    kind_title: str
    counts_note: str
    kind_note: str
    times_note: str
    driver_s: float


def by_source(published: Published | None, ours: Counts) -> dict[str, Counts]:
    return ({published.source: published.by_kind} if published else {}) | {OURS: ours}
