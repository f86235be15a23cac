"""Tables of metrics and severity classes in both runs."""

from collections import Counter
from collections.abc import Sequence

import pandas as pd

from mutator.comparison.compared_runs import Side
from mutator.comparison.pair_sheets import Names, adjusted, whole_and_parts
from mutator.comparison.pairs import Pair
from mutator.statistics.median_intervals import median_difference
from mutator.statistics.paired_statistics import wilcoxon
from mutator.statistics.statistics_sheet import Cell, P, Sheet
from mutator.targets.severity import CLASSES

NO_CONTACT = "no contact"


def metrics_sheets(pairs: Sequence[Pair], a: Side, b: Side, names: Names) -> tuple[Sheet, Sheet]:
    whole: list[tuple[Cell, ...]] = []
    parts: list[tuple[Cell, ...]] = []
    units = {metric.name: (metric.unit, metric.worse) for metric in a.folder.head.metrics}
    usable = [pair for pair in pairs if pair.usable]
    for metric in b.folder.head.metrics:
        name, unit, worse = metric.name, metric.unit, metric.worse
        frame = _values(usable, a, b, name)
        if units.get(name) != (unit, worse) or frame.empty:
            continue
        whole.append((name, unit, worse, *_medians(frame)))
        groups = {str(kind): (unit, worse, *_medians(group)) for kind, group in frame.groupby("kind")}
        parts += adjusted(name, groups)
    note = (
        f"Pairs with a value in both runs. Difference: the median of {names.b} minus that of {names.a}. Its "
        "interval resamples whole faults (variant and value); there is none if all faults agree. p: "
        "Wilcoxon's signed-rank test (none if no pair differs)"
    )
    heads = ("unit", "worse", "pairs", names.a, names.b, "difference", "difference, low", "difference, high")
    return whole_and_parts("metrics", "Metrics", note, ("metric", (*heads, "p")), tuple(whole), parts)


def _values(pairs: Sequence[Pair], a: Side, b: Side, name: str) -> pd.DataFrame:
    """Return the pairs in which both runs have a value of the metric. Columns: `kind`, `fault`, `first`,
    `second`.
    """
    rows = [
        (p.row_a.kind, p.row_a.fault, a.metrics[p.a.id].get(name), b.metrics[p.b.id].get(name)) for p in pairs
    ]
    return pd.DataFrame(rows, columns=["kind", "fault", "first", "second"]).dropna()


def _medians(frame: pd.DataFrame) -> tuple[Cell, ...]:
    first, second = frame["first"], frame["second"]
    found = median_difference(first, second, frame["fault"])
    medians = (float(first.median()), float(second.median()))
    interval = (found.difference, found.low, found.high)
    return (len(frame), *medians, *interval, P(wilcoxon(first, second)))


def severity_sheet(pairs: Sequence[Pair], names: Names) -> Sheet:
    order = [*CLASSES[::-1], ""]
    counts = Counter((p.row_a.severity, p.row_b.severity) for p in pairs if p.usable)
    seen = [name for name in order if any(name in pair for pair in counts)]
    return Sheet(
        name="severity",
        title="Severity",
        note=f"Rows: severity class in {names.a}. Columns: severity class in {names.b}.",
        heads=(f"{names.a} / {names.b}", *(name or NO_CONTACT for name in seen)),
        lines=tuple((one or NO_CONTACT, *(counts[one, other] for other in seen)) for one in seen)
        if any(seen)
        else (),
    )
