"""Summary tables by scenario and by fault type, with published numbers above those of the run."""

from collections.abc import Iterable

from mutator.statistics.published_counts import OURS, Counts, Published
from mutator.statistics.shares import Share, share
from mutator.statistics.statistics_sheet import Cell, Sheet
from mutator.statistics.tallies import Tally, total

_MEASURES = (
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
_WORDS = {"hazards_no_alerts": "hazards without alert", "alerts_no_hazards": "alerts without hazard"}
_NOTE = "Shares with 95 % Wilson intervals; in brackets, the count and the total."


def summary_sheet(method: str, ours: Counts, published: Published | None, *, alerts: bool = True) -> Sheet:
    scenarios = sorted({scenario for how, scenario in ours if how == method})
    theirs = published.by_scenario if published else {}
    sources = _sources(method, ours, published, theirs, scenarios)
    lines: list[tuple[Cell, ...]] = []
    for part, whole in _MEASURES:
        if "alerts" in part and not alerts:
            continue
        for source, tallies in sources.items():
            cells = [_share(one, part, whole) for one in (*tallies.values(), _total(tallies.values()))]
            lines.append((_WORDS.get(part, part), whole, source, *cells))
    notes = (_NOTE, published.counts_note if published else "", "The total covers the scenarios shown.")
    return Sheet(
        name=f"summary_{method}",
        title=_title(f"Summary by scenario, {method}", published.scenario_title if published else ""),
        note=" ".join(filter(None, notes)),
        heads=("what", "of", "from", *scenarios, "total"),
        lines=tuple(lines),
    )


def coverage_sheet(method: str, ours: Counts, published: Published | None) -> Sheet:
    kinds = sorted({kind for how, kind in ours if how == method})
    theirs = published.by_kind if published else {}
    # fault types in the order of the publication, then the rest
    kinds = list(dict.fromkeys([kind for _, kind in theirs if kind in kinds] + kinds))
    sources = _sources(method, ours, published, theirs, kinds)
    lines: list[tuple[Cell, ...]] = []
    for kind in (*kinds, "total"):
        for source, tallies in sources.items():
            one = _total(tallies.values()) if kind == "total" else tallies[kind]
            cells = [_share(one, *measure) for measure in (_MEASURES[0], _MEASURES[2], _MEASURES[3])]
            lines.append((kind, source, *cells))
    notes = (_NOTE, *((published.counts_note, published.kind_note) if published else ()))
    return Sheet(
        name=f"coverage_{method}",
        title=_title(f"Hazard coverage by fault type, {method}", published.kind_title if published else ""),
        note=" ".join(notes),
        heads=("fault type", "from", "activated/injected", "hazards/activated", "hazards/injected"),
        lines=tuple(lines),
    )


def _title(title: str, published: str) -> str:
    return f"{title} ({published})" if published else title


def _sources(
    method: str, ours: Counts, published: Published | None, theirs: Counts, names: Iterable[str]
) -> dict[str, dict[str, Tally | None]]:
    """Return the published counts, if any, and those of the run, by group. None: not published."""
    groups = list(names)
    known = {name: theirs.get((method, name)) for name in groups}
    sources: dict[str, dict[str, Tally | None]] = {}
    if published and any(known.values()):
        sources[published.source] = known
    sources[OURS] = {name: ours[method, name] for name in groups}
    return sources


def _total(tallies: Iterable[Tally | None]) -> Tally:
    return total(one for one in tallies if one is not None)


def _share(one: Tally | None, part: str, whole: str) -> Share | None:
    count, of = (getattr(one, part), getattr(one, whole)) if one else (None, None)
    return None if count is None or of is None else share(count, of)
