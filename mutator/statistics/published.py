"""Published counts of such experiments, to stand beside those of a run."""

from collections.abc import Mapping
from dataclasses import dataclass

from mutator.statistics.tallies import Tally

OURS = "here"  # what the rows of a run are called where others stand beside them
Counts = Mapping[tuple[str, str], Tally]


@dataclass(frozen=True, slots=True, kw_only=True)
class Published:
    """Counts by (method, scenario) and by (method, fault type), and the text that tables show with them.

    `source` names their rows. The titles and notes are added to those of the tables that show them.
    `driver_s` is the driver's reaction time in s that the publication assumes.
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
    """Counts by fault type: the published ones, if there are any, then ours."""
    return ({published.source: published.by_kind} if published else {}) | {OURS: ours}
