"""The tables of a comparison: changes, rates and times in pairs."""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from mutator.comparison.experiment_matching import ExperimentPair, ResultChangeKind, time_to_hazard
from mutator.model import Outcome, Status
from mutator.results.result_rows import ResultRow
from mutator.statistics.guided_against_random import holm_adjusted
from mutator.statistics.paired_statistics import mcnemar_test, paired_times, rate_difference
from mutator.statistics.sample_weights import WEIGHT_COLUMN
from mutator.statistics.statistics_sheet import PValue, Sheet, SheetCell
from mutator.statistics.weighted_shares import share_of_runs
from mutator.store.plan_strata import Stratum

if TYPE_CHECKING:
    import pandas as pd

TIME_COLUMN_BY_EVENT = {
    "activated": "t_activation",
    "manifested": "t_manifest",
    "alert": "t_alert",
    "hazard": "t_hazard",
}
# the last time begins at the first alert, the others at activation
TIME_SPAN_NAMES = ("activation to manifest", "activation to alert", "activation to hazard", "alert to hazard")


def usable_pair_events(
    pairs: Sequence[ExperimentPair], stratum_by_id: Mapping[str, tuple[Stratum, int]] | None = None
) -> "pd.DataFrame":
    """Return a frame with a row for each pair that has valid results in both runs.

    Columns: `kind` (`sensor/bias`), `fault_id` (the resampling unit: variant and value), flags `activated_a`,
    `activated_b` etc., times `activation to hazard_a` etc. in s (NaN if either event is missing). If the
    first run is a sample, `stratum_by_id` has the stratum of each of its experiments, with the stratum's
    size, and the column `weight` says how many planned experiments a pair stands for.
    """
    import pandas as pd

    rows = [
        {
            "kind": p.row_a.kind,
            "fault_id": p.row_a.fault,
            **_event_cells(p.row_a, "a"),
            **_event_cells(p.row_b, "b"),
        }
        for p in pairs
        if p.is_usable
    ]
    names = [f"{name}_{side}" for side in "ab" for name in (*TIME_COLUMN_BY_EVENT, *TIME_SPAN_NAMES)]
    frame = pd.DataFrame(rows, columns=["kind", "fault_id", *names])
    flags = [f"{name}_{side}" for side in "ab" for name in TIME_COLUMN_BY_EVENT]
    frame = frame.astype(dict.fromkeys(flags, bool) | {n: float for n in names if n not in flags})
    if stratum_by_id is None:
        return frame
    weights = weights_of_experiments([p.row_a.experiment_id for p in pairs if p.is_usable], stratum_by_id)
    return frame.assign(**{WEIGHT_COLUMN: weights})


def weights_of_experiments(
    ids: Sequence[str], stratum_by_id: Mapping[str, tuple[Stratum, int]]
) -> list[float]:
    """Return how many planned experiments each of these of a sample stands for, if these alone are left."""
    strata = [stratum_by_id[experiment_id] for experiment_id in ids]
    counts = Counter(strata)
    return [stratum[1] / counts[stratum] for stratum in strata]


def _event_cells(row: ResultRow, side: str) -> dict[str, object]:
    start, alert = row.t_activation, row.t_alert
    hazard = row.hazards[0][1] if row.hazards else None
    spans = (
        _time_between(start, row.t_manifest),
        _time_between(start, alert),
        time_to_hazard(row),
        row.reaction_time,
    )
    flags = (start, row.t_manifest, alert, hazard)
    flags_by_name = dict(zip(TIME_COLUMN_BY_EVENT, (time is not None for time in flags), strict=True))
    return {
        f"{k}_{side}": v for k, v in (flags_by_name | dict(zip(TIME_SPAN_NAMES, spans, strict=True))).items()
    }


def _time_between(start: float | None, end: float | None) -> float:
    return math.nan if start is None or end is None else end - start


@dataclass(frozen=True, slots=True, kw_only=True)
class RunDisplayNames:
    a: str
    b: str


def rates_sheets(frame: "pd.DataFrame", names: RunDisplayNames) -> tuple[Sheet, Sheet]:
    total_lines = tuple((flag, *_rate_cells(frame, flag)) for flag in TIME_COLUMN_BY_EVENT)
    type_lines: list[tuple[SheetCell, ...]] = []
    for flag in TIME_COLUMN_BY_EVENT:
        cells_by_type = {str(kind): _rate_cells(group, flag) for kind, group in frame.groupby("kind")}
        type_lines += lines_with_holm_p(flag, cells_by_type)
    note = (
        f"Pairs with a result in both runs. Difference: the rate of {names.b} minus that of {names.a}, as a "
        "fraction. Its interval resamples whole faults (variant and value); there is none if all faults "
        "agree. p: McNemar's exact test of the pairs that differ"
    )
    if WEIGHT_COLUMN in frame:
        note += ". Rates and differences are weighted, because the pairs are a sample; the counts are not"
    heads = (
        *("pairs", names.a, names.b, f"only {names.a}", f"only {names.b}"),
        *("difference", "difference, low", "difference, high", "p"),
    )
    return total_and_type_sheets("rates", "Rates of events", note, ("what", heads), total_lines, type_lines)


def _rate_cells(frame: "pd.DataFrame", flag: str) -> tuple[SheetCell, ...]:
    first, second = frame[f"{flag}_a"], frame[f"{flag}_b"]
    weights = frame.get(WEIGHT_COLUMN)
    m, change = mcnemar_test(first, second), rate_difference(first, second, frame["fault_id"], weights)
    rates: tuple[SheetCell, ...] = tuple(
        share_of_runs(frame, flags, flags | True) for flags in (first, second)
    )
    return (
        *(m.pair_count, *rates, m.first_only, m.second_only),
        *(change.difference, change.low, change.high, PValue(m.p_value)),
    )


def times_sheets(frame: "pd.DataFrame", names: RunDisplayNames) -> tuple[Sheet, Sheet]:
    complete_pairs = {
        name: frame[frame[[f"{name}_a", f"{name}_b"]].notna().all(axis=1)] for name in TIME_SPAN_NAMES
    }
    total_lines = tuple(
        (name, *_time_cells(some, name)) for name, some in complete_pairs.items() if len(some)
    )
    type_lines: list[tuple[SheetCell, ...]] = []
    for name, some in complete_pairs.items():
        type_lines += lines_with_holm_p(
            name, {str(kind): _time_cells(group, name) for kind, group in some.groupby("kind")}
        )
    note = (
        f"Medians in s. Difference: the median of the pairs' differences, {names.b} minus {names.a}, with "
        "its exact interval (none for fewer than six pairs). p: Wilcoxon's signed-rank test (none if no pair "
        "differs)"
    )
    heads = ("pairs", names.a, names.b, "difference", "difference, low", "difference, high", "p")
    return total_and_type_sheets(
        "times",
        "Times between events that occur in both runs",
        note,
        ("time", heads),
        total_lines,
        type_lines,
    )


def _time_cells(frame: "pd.DataFrame", name: str) -> tuple[SheetCell, ...]:
    t = paired_times(frame[f"{name}_a"], frame[f"{name}_b"])
    return (
        t.pair_count,
        t.first_median,
        t.second_median,
        t.median_difference.difference,
        t.median_difference.low,
        t.median_difference.high,
        PValue(t.p_value),
    )


def lines_with_holm_p(
    measure: str, cells_by_type: Mapping[str, tuple[SheetCell, ...]]
) -> list[tuple[SheetCell, ...]]:
    """Return the lines of one measure by fault type, with Holm's adjusted p added after the last cell, which
    is p.
    """
    p_values = {kind: cells[-1] for kind, cells in cells_by_type.items()}
    defined_p_values = {
        kind: p for kind, p in p_values.items() if isinstance(p, PValue) and not math.isnan(p)
    }
    holm_values = dict(
        zip(defined_p_values, map(PValue, holm_adjusted(list(defined_p_values.values()))), strict=True)
    )
    return [(measure, kind, *cells, holm_values.get(kind)) for kind, cells in cells_by_type.items()]


def total_and_type_sheets(
    name: str,
    title: str,
    note: str,
    heads: tuple[str, tuple[str, ...]],
    total_lines: tuple[tuple[SheetCell, ...], ...],
    type_lines: Sequence[tuple[SheetCell, ...]],
) -> tuple[Sheet, Sheet]:
    """Return the table of all pairs and the table by fault type. `heads` has the heading of the first column,
    then those of the others.
    """
    what, numbers = heads
    return (
        Sheet(name=name, title=title, note=f"{note}.", heads=(what, *numbers), lines=total_lines),
        Sheet(
            name=f"{name}_by_fault_type",
            title=f"{title}, by fault type",
            note=f"{note}; p, Holm: adjusted over the fault types.",
            heads=(what, "fault type", *numbers, "p, Holm"),
            lines=tuple(type_lines),
        ),
    )


def change_counts_sheet(pairs: Sequence[ExperimentPair]) -> Sheet:
    changes = [change for change in ResultChangeKind if any(change in p.change_kinds for p in pairs)]
    kinds = sorted({p.row_a.kind for p in pairs})
    parts = {kind: [p for p in pairs if p.row_a.kind == kind] for kind in kinds}
    lines = tuple(_count_line(kind, part, changes) for kind, part in parts.items())
    return Sheet(
        name="changes",
        title="What changed",
        note="A pair can change in several ways. Same: none of these changes.",
        heads=("fault type", "pairs", "same", *(change.value for change in changes)),
        lines=(*lines, _count_line("total", pairs, changes)),
    )


def _count_line(
    name: str, pairs: Sequence[ExperimentPair], changes: Sequence[ResultChangeKind]
) -> tuple[SheetCell, ...]:
    same = sum(not p.change_kinds for p in pairs)
    return (name, len(pairs), same, *(sum(change in p.change_kinds for p in pairs) for change in changes))


def endings_cross_table(pairs: Sequence[ExperimentPair], names: RunDisplayNames) -> Sheet:
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
