"""The tables of a comparison: changes, rates and times in pairs."""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import pandas as pd

from mutator.comparison.pairs import Change, Pair, time_to_hazard
from mutator.model import Outcome, Status
from mutator.results.result_rows import Row
from mutator.statistics.guided_against_random import holm
from mutator.statistics.paired_statistics import mcnemar, rate_difference, times
from mutator.statistics.shares import share
from mutator.statistics.statistics_sheet import Cell, P, Sheet

FLAGS = {"activated": "t_activation", "manifested": "t_manifest", "alert": "t_alert", "hazard": "t_hazard"}
# the last time begins at the first alert, the others at activation
TIMES = ("activation to manifest", "activation to alert", "activation to hazard", "alert to hazard")


def frame_of(pairs: Sequence[Pair]) -> pd.DataFrame:
    """Return a frame with a row for each pair that has valid results in both runs.

    Columns: `kind` (`sensor/bias`), `fault` (the resampling unit: variant and value), flags `activated_a`,
    `activated_b` etc., times `activation to hazard_a` etc. in s (NaN if either event is missing).
    """
    rows = [
        {
            "kind": p.row_a.kind,
            "fault": p.row_a.fault,
            **_cells(p.row_a, "a"),
            **_cells(p.row_b, "b"),
        }
        for p in pairs
        if p.usable
    ]
    names = [f"{name}_{side}" for side in "ab" for name in (*FLAGS, *TIMES)]
    frame = pd.DataFrame(rows, columns=["kind", "fault", *names])
    flags = [f"{name}_{side}" for side in "ab" for name in FLAGS]
    return frame.astype(dict.fromkeys(flags, bool) | {n: float for n in names if n not in flags})


def _cells(row: Row, side: str) -> dict[str, object]:
    start, alert = row.t_activation, row.t_alert
    hazard = row.hazards[0][1] if row.hazards else None
    spans = (_span(start, row.t_manifest), _span(start, alert), time_to_hazard(row), row.reaction_time)
    flags = (start, row.t_manifest, alert, hazard)
    told = dict(zip(FLAGS, (time is not None for time in flags), strict=True))
    return {f"{k}_{side}": v for k, v in (told | dict(zip(TIMES, spans, strict=True))).items()}


def _span(start: float | None, end: float | None) -> float:
    return math.nan if start is None or end is None else end - start


@dataclass(frozen=True, slots=True, kw_only=True)
class Names:
    a: str
    b: str


def rates_sheets(frame: pd.DataFrame, names: Names) -> tuple[Sheet, Sheet]:
    whole = tuple((flag, *_rates(frame, flag)) for flag in FLAGS)
    parts: list[tuple[Cell, ...]] = []
    for flag in FLAGS:
        found = {str(kind): _rates(group, flag) for kind, group in frame.groupby("kind")}
        parts += adjusted(flag, found)
    note = (
        f"Pairs with a result in both runs. Difference: the rate of {names.b} minus that of {names.a}, as a "
        "fraction. Its interval resamples whole faults (variant and value); there is none if all faults "
        "agree. p: McNemar's exact test of the pairs that differ"
    )
    heads = (
        *("pairs", names.a, names.b, f"only {names.a}", f"only {names.b}"),
        *("difference", "difference, low", "difference, high", "p"),
    )
    return whole_and_parts("rates", "Rates of events", note, ("what", heads), whole, parts)


def _rates(frame: pd.DataFrame, flag: str) -> tuple[Cell, ...]:
    first, second = frame[f"{flag}_a"], frame[f"{flag}_b"]
    m, change = mcnemar(first, second), rate_difference(first, second, frame["fault"])
    rates = (share(m.both + m.first_only, m.pairs), share(m.both + m.second_only, m.pairs))
    return (
        *(m.pairs, *rates, m.first_only, m.second_only),
        *(change.difference, change.low, change.high, P(m.p)),
    )


def times_sheets(frame: pd.DataFrame, names: Names) -> tuple[Sheet, Sheet]:
    known = {name: frame[frame[[f"{name}_a", f"{name}_b"]].notna().all(axis=1)] for name in TIMES}
    whole = tuple((name, *_times(some, name)) for name, some in known.items() if len(some))
    parts: list[tuple[Cell, ...]] = []
    for name, some in known.items():
        parts += adjusted(name, {str(kind): _times(group, name) for kind, group in some.groupby("kind")})
    note = (
        f"Medians in s. Difference: the median of the pairs' differences, {names.b} minus {names.a}, with "
        "its exact interval (none for fewer than six pairs). p: Wilcoxon's signed-rank test (none if no pair "
        "differs)"
    )
    heads = ("pairs", names.a, names.b, "difference", "difference, low", "difference, high", "p")
    return whole_and_parts(
        "times", "Times between events that occur in both runs", note, ("time", heads), whole, parts
    )


def _times(frame: pd.DataFrame, name: str) -> tuple[Cell, ...]:
    t = times(frame[f"{name}_a"], frame[f"{name}_b"])
    return (t.n, t.first, t.second, t.median.difference, t.median.low, t.median.high, P(t.p))


def adjusted(name: str, found: Mapping[str, tuple[Cell, ...]]) -> list[tuple[Cell, ...]]:
    """Return the lines of one measure by fault type, with Holm's adjusted p added after the last cell, which
    is p.
    """
    p_values = {kind: cells[-1] for kind, cells in found.items()}
    known = {kind: p for kind, p in p_values.items() if isinstance(p, P) and not math.isnan(p)}
    holm_values = dict(zip(known, map(P, holm(list(known.values()))), strict=True))
    return [(name, kind, *cells, holm_values.get(kind)) for kind, cells in found.items()]


def whole_and_parts(
    name: str,
    title: str,
    note: str,
    heads: tuple[str, tuple[str, ...]],
    whole: tuple[tuple[Cell, ...], ...],
    parts: Sequence[tuple[Cell, ...]],
) -> tuple[Sheet, Sheet]:
    """Return the table of all pairs and the table by fault type. `heads` has the heading of the first column,
    then those of the others.
    """
    what, numbers = heads
    return (
        Sheet(name=name, title=title, note=f"{note}.", heads=(what, *numbers), lines=whole),
        Sheet(
            name=f"{name}_by_fault_type",
            title=f"{title}, by fault type",
            note=f"{note}; p, Holm: adjusted over the fault types.",
            heads=(what, "fault type", *numbers, "p, Holm"),
            lines=tuple(parts),
        ),
    )


def changes_sheet(pairs: Sequence[Pair]) -> Sheet:
    seen = [change for change in Change if any(change in p.changes for p in pairs)]
    kinds = sorted({p.row_a.kind for p in pairs})
    parts = {kind: [p for p in pairs if p.row_a.kind == kind] for kind in kinds}
    lines = tuple(_count_line(kind, part, seen) for kind, part in parts.items())
    return Sheet(
        name="changes",
        title="What changed",
        note="A pair can change in several ways. Same: none of these changes.",
        heads=("fault type", "pairs", "same", *(change.value for change in seen)),
        lines=(*lines, _count_line("total", pairs, seen)),
    )


def _count_line(name: str, pairs: Sequence[Pair], seen: Sequence[Change]) -> tuple[Cell, ...]:
    same = sum(not p.changes for p in pairs)
    return (name, len(pairs), same, *(sum(change in p.changes for p in pairs) for change in seen))


def endings_sheet(pairs: Sequence[Pair], names: Names) -> Sheet:
    counts = Counter((p.row_a.ending, p.row_b.ending) for p in pairs)
    order = [*(o.value for o in Outcome), *(s.value for s in Status if s is not Status.OK)]
    before, after = ([e for e in order if any(pair[i] == e for pair in counts)] for i in (0, 1))
    return Sheet(
        name="endings",
        title="How they ended",
        note=f"Rows: outcome or status in {names.a}. Columns: outcome or status in {names.b}.",
        heads=(f"{names.a} / {names.b}", *after),
        lines=tuple((a, *(counts[a, b] for b in after)) for a in before),
    )
