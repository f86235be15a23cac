"""Summary tables by scenario and by fault type, with published numbers above those of the run."""

from collections.abc import Callable, Iterable, Sequence
from operator import itemgetter
from typing import TYPE_CHECKING

from mutator.results.outcome_counting import families_or_scenarios_of
from mutator.statistics.published_counts import THIS_RUN, PublishedCounts, TallyByGroup
from mutator.statistics.shares_with_intervals import Share, share_with_interval
from mutator.statistics.statistics_sheet import Sheet, SheetCell
from mutator.statistics.tallies import Tally, flag_of_count, sum_tallies
from mutator.statistics.weighted_shares import share_of_runs

if TYPE_CHECKING:
    import pandas as pd

_PART_AND_WHOLE_PAIRS = (
    ("activated", "injected"),
    ("manifested", "activated"),
    ("hazards", "activated"),
    ("hazards", "injected"),
    ("alerts", "activated"),
    ("alerts", "injected"),
    ("hazards_no_alerts", "activated"),
    ("hazards_no_alerts", "hazards"),
    ("alerts_no_hazards", "activated"),
)
_HEADING_BY_MEASURE = {
    "hazards_no_alerts": "hazards without alert",
    "alerts_no_hazards": "alerts without hazard",
}
_NOTE = "Shares with 95 % Wilson intervals; in brackets, the count and the total."
SAMPLE_NOTE = (
    "Shares of a sample are weighted, and their intervals come from resampling whole faults; in brackets, "
    "the counts of drawn runs."
)


def summary_sheet(
    method: str,
    run_counts: TallyByGroup,
    published: PublishedCounts | None,
    *,
    has_alerts: bool = True,
    sample: "pd.DataFrame | None" = None,
) -> Sheet:
    """Tabulate the counts by scenario. `sample`: the runs, if they are one, whose shares are weighted."""
    scenarios = sorted({scenario for how, scenario in run_counts if how == method})
    published_tallies = published.by_scenario if published else {}
    sources = _tallies_by_source(method, run_counts, published, published_tallies, scenarios)
    lines: list[tuple[SheetCell, ...]] = []
    for part, whole in _PART_AND_WHOLE_PAIRS:
        if "alerts" in part and not has_alerts:
            continue
        for source, tallies in sources.items():
            cells: Sequence[Share | None]
            if source == THIS_RUN and sample is not None:
                cells = _weighted_cells(sample, method, families_or_scenarios_of, scenarios, (part, whole))
            else:
                cells = [
                    _share_of_tally(tally, part, whole)
                    for tally in (*tallies.values(), _total_of_published(tallies.values()))
                ]
            lines.append((_HEADING_BY_MEASURE.get(part, part), whole, source, *cells))
    notes = (
        _NOTE if sample is None else SAMPLE_NOTE,
        published.counts_note if published else "",
        "The total covers the scenarios shown.",
    )
    return Sheet(
        name=f"summary_{method}",
        title=_title(f"Summary by scenario, {method}", published.scenario_title if published else ""),
        note=" ".join(filter(None, notes)),
        heads=("what", "of", "from", *scenarios, "total"),
        lines=tuple(lines),
    )


def coverage_sheet(
    method: str,
    run_counts: TallyByGroup,
    published: PublishedCounts | None,
    *,
    sample: "pd.DataFrame | None" = None,
) -> Sheet:
    """Tabulate the counts by fault type. `sample` is as in `summary_sheet`."""
    kinds = sorted({kind for how, kind in run_counts if how == method})
    published_tallies = published.by_fault_type if published else {}
    # fault types in the order of the publication, then the rest
    kinds = list(dict.fromkeys([kind for _, kind in published_tallies if kind in kinds] + kinds))
    sources = _tallies_by_source(method, run_counts, published, published_tallies, kinds)
    measures = (_PART_AND_WHOLE_PAIRS[0], *_PART_AND_WHOLE_PAIRS[2:4])
    weighted: dict[str, list[Share]] = {}
    if sample is not None:
        columns = [
            _weighted_cells(sample, method, itemgetter("kind"), kinds, measure) for measure in measures
        ]
        weighted = {name: list(cells) for name, *cells in zip((*kinds, "total"), *columns, strict=True)}
    lines: list[tuple[SheetCell, ...]] = []
    for kind in (*kinds, "total"):
        for source, tallies in sources.items():
            if source == THIS_RUN and weighted:
                lines.append((kind, source, *weighted[kind]))
                continue
            tally = _total_of_published(tallies.values()) if kind == "total" else tallies[kind]
            lines.append((kind, source, *(_share_of_tally(tally, *measure) for measure in measures)))
    notes = (
        _NOTE if sample is None else SAMPLE_NOTE,
        *((published.counts_note, published.fault_type_note) if published else ()),
    )
    return Sheet(
        name=f"coverage_{method}",
        title=_title(
            f"Hazard coverage by fault type, {method}", published.fault_type_title if published else ""
        ),
        note=" ".join(notes),
        heads=("fault type", "from", "activated/injected", "hazards/activated", "hazards/injected"),
        lines=tuple(lines),
    )


def _weighted_cells(
    sample: "pd.DataFrame",
    method: str,
    groups_of: "Callable[[pd.DataFrame], pd.Series]",
    names: Iterable[str],
    measure: tuple[str, str],
) -> list[Share]:
    """Return the share of each group of a method's runs, then that of all."""
    runs = sample[sample["method"] == method]
    part, whole = (flag_of_count(runs, name) for name in measure)
    groups = groups_of(runs)
    shares = [share_of_runs(runs, part, whole & (groups == name)) for name in names]
    return [*shares, share_of_runs(runs, part, whole)]


def _title(title: str, published: str) -> str:
    return f"{title} ({published})" if published else title


def _tallies_by_source(
    method: str,
    run_counts: TallyByGroup,
    published: PublishedCounts | None,
    published_tallies: TallyByGroup,
    names: Iterable[str],
) -> dict[str, dict[str, Tally | None]]:
    """Return the published counts, if any, and those of the run, by group. None: not published."""
    groups = list(names)
    published_by_name = {name: published_tallies.get((method, name)) for name in groups}
    sources: dict[str, dict[str, Tally | None]] = {}
    if published and any(published_by_name.values()):
        sources[published.source] = published_by_name
    sources[THIS_RUN] = {name: run_counts[method, name] for name in groups}
    return sources


def _total_of_published(tallies: Iterable[Tally | None]) -> Tally:
    return sum_tallies(tally for tally in tallies if tally is not None)


def _share_of_tally(tally: Tally | None, part: str, whole: str) -> Share | None:
    count, of = (getattr(tally, part), getattr(tally, whole)) if tally else (None, None)
    return None if count is None or of is None else share_with_interval(count, of)
