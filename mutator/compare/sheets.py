"""The tables of a comparison: what changed, rates and times in pairs."""

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import pandas as pd

from mutator.compare.pairs import Change, Pair, time_to_hazard
from mutator.model import Outcome, Status
from mutator.statistics.compare import holm
from mutator.statistics.paired import Matched, Times, mcnemar, rate_difference, times
from mutator.statistics.share import share
from mutator.statistics.sheet import Cell, P, Sheet
from mutator.tables import Row, by_fault_type

FLAGS = {"activated": "t_activation", "manifested": "t_manifest", "alert": "t_alert", "hazard": "t_hazard"}
# of an experiment, each counted from its activation; the last from its first alert
TIMES = ("activation to manifest", "activation to alert", "activation to hazard", "alert to hazard")
_IN_ALL = "in all"


def frame_of(pairs: Sequence[Pair]) -> pd.DataFrame:
    """A row for each pair in which both runs say something about the fault.

    `kind` (`radar/chaff`), `fault` (what is resampled: variant and value), flags `activated_a`, `activated_b`
    and so on, times `activation to hazard_a` and so on, s, NaN: not both of them came.
    """
    rows = [
        {
            "kind": by_fault_type(p.row_a),
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
    """What the two runs are called in tables."""

    a: str
    b: str


def groups(frame: pd.DataFrame) -> Iterator[tuple[str, pd.DataFrame]]:
    """All pairs, then those of each fault type."""
    yield _IN_ALL, frame
    for kind, group in frame.groupby("kind"):
        yield str(kind), group


def rates_sheet(frame: pd.DataFrame, names: Names) -> Sheet:
    """For each flag, in all and of each fault type: rates, their difference, McNemar's exact test."""
    lines: list[tuple[Cell, ...]] = []
    for flag in FLAGS:
        found = {kind: (_matched(g, flag), g) for kind, g in groups(frame)}
        adjusted = _adjusted({kind: m.p for kind, (m, _) in found.items() if kind != _IN_ALL})
        for kind, (m, group) in found.items():
            change = rate_difference(group[f"{flag}_a"], group[f"{flag}_b"], group["fault"])
            rates = (share(m.both + m.first_only, m.pairs), share(m.both + m.second_only, m.pairs))
            lines.append(
                (
                    *(flag, kind, m.pairs, *rates, m.first_only, m.second_only),
                    *(change.difference, change.low, change.high, P(m.p), adjusted.get(kind)),
                )
            )
    return Sheet(
        name="rates",
        title="What came in how many runs",
        note=f"Pairs with a result on both sides. Difference: the rate of {names.b} less that of {names.a} "
        "(of 1), its interval resampled by fault (variant and value). p: McNemar's exact test of the pairs "
        "that differ; p, Holm: adjusted over the fault types.",
        heads=(
            *("what", "fault type", "pairs", names.a, names.b, f"only {names.a}", f"only {names.b}"),
            *("difference", "difference, low", "difference, high", "p", "p, Holm"),
        ),
        lines=tuple(lines),
    )


def _matched(frame: pd.DataFrame, flag: str) -> Matched:
    return mcnemar(frame[f"{flag}_a"], frame[f"{flag}_b"])


def _adjusted(p_values: dict[str, float]) -> dict[str, Cell]:
    known = {kind: p for kind, p in p_values.items() if not math.isnan(p)}
    return {kind: P(p) for kind, p in zip(known, holm(list(known.values())), strict=True)}


def times_sheet(frame: pd.DataFrame, names: Names) -> Sheet:
    """For each time, in all and of each fault type that has it: medians, their difference, Wilcoxon."""
    lines: list[tuple[Cell, ...]] = []
    for name in TIMES:
        found: dict[str, Times] = {k: times(g[f"{name}_a"], g[f"{name}_b"]) for k, g in groups(frame)}
        adjusted = _adjusted({kind: t.p for kind, t in found.items() if kind != _IN_ALL})
        lines += [
            (
                *(name, kind, t.n, t.first, t.second),
                *(t.median.difference, t.median.low, t.median.high, P(t.p), adjusted.get(kind)),
            )
            for kind, t in found.items()
            if t.n
        ]
    return Sheet(
        name="times",
        title="How long it took, where it came in both runs",
        note=f"Medians in s. Difference: the median of the pairs' differences, {names.b} less {names.a}, "
        "with its exact interval (none for fewer than six pairs); p: Wilcoxon's signed-rank test (none where "
        "no pair differs); p, Holm: adjusted over the fault types.",
        heads=(
            *("time", "fault type", "pairs", names.a, names.b),
            *("difference", "difference, low", "difference, high", "p", "p, Holm"),
        ),
        lines=tuple(lines),
    )


def changes_sheet(pairs: Sequence[Pair]) -> Sheet:
    """How many pairs of each fault type changed how; only changes that there are."""
    seen = [change for change in Change if any(change in p.changes for p in pairs)]
    kinds = sorted({by_fault_type(p.row_a) for p in pairs})
    parts = {kind: [p for p in pairs if by_fault_type(p.row_a) == kind] for kind in kinds}
    lines = tuple(_count_line(kind, part, seen) for kind, part in parts.items())
    return Sheet(
        name="changes",
        title="What changed",
        note="A pair may have changed in several ways. Same: none of what is listed here changed.",
        heads=("fault type", "pairs", "same", *(change.value for change in seen)),
        lines=(*lines, _count_line("total", pairs, seen)),
    )


def _count_line(name: str, pairs: Sequence[Pair], seen: Sequence[Change]) -> tuple[Cell, ...]:
    same = sum(not p.changes for p in pairs)
    return (name, len(pairs), same, *(sum(change in p.changes for p in pairs) for change in seen))


def endings_sheet(pairs: Sequence[Pair], names: Names) -> Sheet:
    """How many pairs ended how in the first run (lines) and in the second (columns)."""
    counts = Counter((p.row_a.ending, p.row_b.ending) for p in pairs)
    order = [*(o.value for o in Outcome), *(s.value for s in Status if s is not Status.OK)]
    before, after = ([e for e in order if any(pair[i] == e for pair in counts)] for i in (0, 1))
    return Sheet(
        name="endings",
        title="How they ended",
        note=f"Each line is how the experiments ended in {names.a}, each column how in {names.b}.",
        heads=(f"{names.a} / {names.b}", *after),
        lines=tuple((a, *(counts[a, b] for b in after)) for a in before),
    )
