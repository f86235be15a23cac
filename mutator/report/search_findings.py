"""What a report says of a search for hazardous faults."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from mutator._common.message_text import counted
from mutator._common.table_rendering import TextTable
from mutator.campaigns.exploration_section import ExploredPlane
from mutator.explore.envelope_texts import findings_table, shortest_first
from mutator.explore.exploration_replay import ExplorationReplay
from mutator.explore.finding_search import Finding, FindingSearch
from mutator.report.random_searches import RandomSearch

FINDINGS_NOTE = (
    "A finding is a hazard of one fault in one scenario from one start on, with the smallest fault that "
    "reached it (the least product of magnitude and duration). Inferred durations were not driven: the "
    "experiment's longer fault reached the hazard in that time, while active. It is a bound: a smaller "
    "fault that was not tried can do the same. `mutator shrink ID` searches its smallest form."
)


_NO_RANDOM_SEARCH = (
    "A search of the same faults with `--strategy random`, in the same folder of runs, is shown beside it."
)


@dataclass(frozen=True, kw_only=True)
class SearchFindings:
    """The findings of a run. `note` says what is unfinished."""

    findings: Sequence[Finding]
    planes: Sequence[ExploredPlane]
    counts: Sequence[int]  # of findings after each run
    note: str = ""

    @classmethod
    def of_replay(cls, replay: ExplorationReplay) -> "SearchFindings | None":
        """Return those of a replayed search; None for another exploration."""
        search = replay.exploration
        if not isinstance(search, FindingSearch):
            return None
        return cls(
            findings=search.findings(),
            planes=search.section.planes,
            counts=search.finding_counts(),
            note=replay.note,
        )

    @property
    def linked_ids(self) -> set[str]:
        """The ids of the experiments to which the table has links."""
        return {finding.result.experiment_id for finding in self.findings}

    def sentence(self) -> str:
        """Return how many findings there are, in how many planes and runs."""
        planes = len({finding.plane for finding in self.findings})
        return (
            f"The search has {counted(len(self.findings), 'finding')} in {planes} of "
            f"{counted(len(self.planes), 'plane')}, from {counted(len(self.counts), 'run')}."
        )

    def table(self, *, with_links: bool) -> TextTable:
        """Return a row for each finding; with links for the page, not for Markdown."""
        table = findings_table(self.findings, self.planes)
        if not with_links:
            return table
        from markupsafe import Markup

        link = Markup('<a href="#e={}"><code>{}</code></a>').format
        names = [finding.result.experiment_id for finding in shortest_first(self.findings, self.planes)]
        rows = [[*cells, link(name, short)] for (*cells, short), name in zip(table.rows, names, strict=True)]
        return replace(table, rows=rows)


def describe_random_searches(counts: Sequence[int], searches: Sequence[RandomSearch]) -> str:
    """Return the findings of a search beside those of random ones, after as many runs as all of them have."""
    runs = min([len(counts), *(len(search.counts) for search in searches)])
    if not searches or not runs:
        return _NO_RANDOM_SEARCH
    random_counts = ", ".join(f"{search.counts[runs - 1]} (`{search.name}`)" for search in searches)
    return (
        f"After {counted(runs, 'run')}: {counts[runs - 1]}, and drawn at random {random_counts}; dashed in "
        "the picture."
    )
