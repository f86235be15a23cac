"""The paper's tables II and III: the paper's numbers with ours beneath, an interval and N in every cell."""

from collections.abc import Iterable, Mapping

from mutator.paper.published import Paper
from mutator.statistics.share import Share, share
from mutator.statistics.sheet import Cell, Sheet
from mutator.statistics.tally import Tally, total

Counts = Mapping[tuple[str, str], Tally]
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
_NOTE = "95 % Wilson intervals; in brackets count/whole."
_CITED = f"{_NOTE} The paper's counts are cited, their intervals are ours."


def summary_sheet(method: str, ours: Counts, paper: Paper | None) -> Sheet:
    """Table II of one method: a column for each scenario of ours, and all of them together."""
    scenarios = sorted({scenario for how, scenario in ours if how == method})
    sources = _sources(method, ours, paper.summary if paper else None, scenarios)
    lines: list[tuple[Cell, ...]] = []
    for part, whole in _MEASURES:
        for source, tallies in sources.items():
            cells = [_share(one, part, whole) for one in (*tallies.values(), _total(tallies.values()))]
            lines.append((_WORDS.get(part, part), whole, source, *cells))
    return Sheet(
        name=f"summary_{method}",
        title=f"Summary by scenario, {method}" + (" (the paper's table II)" if paper else ""),
        note=f"{_CITED if paper else _NOTE} The total is of the scenarios shown.",
        heads=("what", "of", "from", *scenarios, "total"),
        lines=tuple(lines),
    )


def coverage_sheet(method: str, ours: Counts, paper: Paper | None) -> Sheet:
    """Table III of one method: a line for each fault type of ours, and all of them together."""
    kinds = sorted({kind for how, kind in ours if how == method})
    if paper:  # in its order, then what it does not have
        kinds = list(dict.fromkeys([k for _, k in paper.coverage if k in kinds] + kinds))
    sources = _sources(method, ours, paper.coverage if paper else None, kinds)
    lines: list[tuple[Cell, ...]] = []
    for kind in (*kinds, "total"):
        for source, tallies in sources.items():
            one = _total(tallies.values()) if kind == "total" else tallies[kind]
            cells = [_share(one, *measure) for measure in (_MEASURES[0], _MEASURES[2], _MEASURES[3])]
            lines.append((kind, source, *cells))
    return Sheet(
        name=f"coverage_{method}",
        title=f"Hazard coverage by fault type, {method}" + (" (the paper's table III)" if paper else ""),
        note=f"{_CITED} The paper divides by activated faults; hazards/injected is what experiments yield."
        if paper
        else _NOTE,
        heads=("fault type", "from", "activated/injected", "hazards/activated", "hazards/injected"),
        lines=tuple(lines),
    )


def _sources(
    method: str, ours: Counts, published: Counts | None, groups: Iterable[str]
) -> dict[str, dict[str, Tally | None]]:
    """Paper (if it says anything of these groups) and ours, by group; None: not in the paper."""
    names = list(groups)
    sources: dict[str, dict[str, Tally | None]] = {}
    known = {name: (published or {}).get((method, name)) for name in names}
    if any(known.values()):
        sources["paper"] = known
    sources["here"] = {name: ours[method, name] for name in names}
    return sources


def _total(tallies: Iterable[Tally | None]) -> Tally:
    return total(one for one in tallies if one is not None)


def _share(one: Tally | None, part: str, whole: str) -> Share | None:
    count, of = (getattr(one, part), getattr(one, whole)) if one else (None, None)
    return None if count is None or of is None else share(count, of)
