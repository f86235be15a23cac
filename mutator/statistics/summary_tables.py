"""Summary tables by scenario and by fault type, with published numbers above those of the run."""

from collections.abc import Iterable

from mutator.statistics.published_counts import THIS_RUN, PublishedCounts, TallyByGroup
from mutator.statistics.shares_with_intervals import Share, share_with_interval
from mutator.statistics.statistics_sheet import Sheet, SheetCell
from mutator.statistics.tallies import Tally, sum_tallies

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


def summary_sheet(
    method: str, run_counts: TallyByGroup, published: PublishedCounts | None, *, has_alerts: bool = True
) -> Sheet:
    scenarios = sorted({scenario for how, scenario in run_counts if how == method})
    published_tallies = published.by_scenario if published else {}
    sources = _tallies_by_source(method, run_counts, published, published_tallies, scenarios)
    lines: list[tuple[SheetCell, ...]] = []
    for part, whole in _PART_AND_WHOLE_PAIRS:
        if "alerts" in part and not has_alerts:
            continue
        for source, tallies in sources.items():
            cells = [
                _share_of_tally(tally, part, whole)
                for tally in (*tallies.values(), _total_of_published(tallies.values()))
            ]
            lines.append((_HEADING_BY_MEASURE.get(part, part), whole, source, *cells))
    notes = (_NOTE, published.counts_note if published else "", "The total covers the scenarios shown.")
    return Sheet(
        name=f"summary_{method}",
        title=_title(f"Summary by scenario, {method}", published.scenario_title if published else ""),
        note=" ".join(filter(None, notes)),
        heads=("what", "of", "from", *scenarios, "total"),
        lines=tuple(lines),
    )


def coverage_sheet(method: str, run_counts: TallyByGroup, published: PublishedCounts | None) -> Sheet:
    kinds = sorted({kind for how, kind in run_counts if how == method})
    published_tallies = published.by_fault_type if published else {}
    # fault types in the order of the publication, then the rest
    kinds = list(dict.fromkeys([kind for _, kind in published_tallies if kind in kinds] + kinds))
    sources = _tallies_by_source(method, run_counts, published, published_tallies, kinds)
    lines: list[tuple[SheetCell, ...]] = []
    for kind in (*kinds, "total"):
        for source, tallies in sources.items():
            tally = _total_of_published(tallies.values()) if kind == "total" else tallies[kind]
            cells = [
                _share_of_tally(tally, *measure)
                for measure in (_PART_AND_WHOLE_PAIRS[0], _PART_AND_WHOLE_PAIRS[2], _PART_AND_WHOLE_PAIRS[3])
            ]
            lines.append((kind, source, *cells))
    notes = (_NOTE, *((published.counts_note, published.fault_type_note) if published else ()))
    return Sheet(
        name=f"coverage_{method}",
        title=_title(
            f"Hazard coverage by fault type, {method}", published.fault_type_title if published else ""
        ),
        note=" ".join(notes),
        heads=("fault type", "from", "activated/injected", "hazards/activated", "hazards/injected"),
        lines=tuple(lines),
    )


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
