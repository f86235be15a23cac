"""Tables of metrics and severity classes in both runs."""

from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING

from mutator.comparison.compared_runs import ComparedRun
from mutator.comparison.experiment_matching import ExperimentPair
from mutator.comparison.paired_rate_and_time_sheets import (
    RunDisplayNames,
    lines_with_holm_p,
    total_and_type_sheets,
)
from mutator.statistics.bootstrap_median_intervals import median_difference
from mutator.statistics.metric_and_severity_tables import describe_severity_classes
from mutator.statistics.paired_statistics import wilcoxon_p
from mutator.statistics.statistics_sheet import PValue, Sheet, SheetCell
from mutator.targets.hazard_severity import SEVERITY_CLASSES, SeverityScale

if TYPE_CHECKING:
    import pandas as pd

NO_CLASS = "no class"


def metrics_sheets(
    pairs: Sequence[ExperimentPair], a: ComparedRun, b: ComparedRun, names: RunDisplayNames
) -> tuple[Sheet, Sheet]:
    whole: list[tuple[SheetCell, ...]] = []
    parts: list[tuple[SheetCell, ...]] = []
    units = {metric.name: (metric.unit, metric.worse) for metric in a.folder.head.metrics}
    usable = [pair for pair in pairs if pair.is_usable]
    for metric in b.folder.head.metrics:
        name, unit, worse = metric.name, metric.unit, metric.worse
        frame = _metric_values(usable, a, b, name)
        # in another unit or direction, it is another metric with the same name
        if units.get(name) != (unit, worse) or frame.empty:
            continue
        whole.append((name, unit, worse, *_median_cells(frame)))
        groups = {str(kind): (unit, worse, *_median_cells(group)) for kind, group in frame.groupby("kind")}
        parts += lines_with_holm_p(name, groups)
    note = (
        f"Pairs with a value in both runs. Difference: the median of {names.b} minus that of {names.a}. Its "
        "interval resamples whole faults (variant and value); there is none if all faults agree. p: "
        "Wilcoxon's signed-rank test (none if no pair differs)"
    )
    heads = ("unit", "worse", "pairs", names.a, names.b, "difference", "difference, low", "difference, high")
    return total_and_type_sheets("metrics", "Metrics", note, ("metric", (*heads, "p")), tuple(whole), parts)


def _metric_values(
    pairs: Sequence[ExperimentPair], a: ComparedRun, b: ComparedRun, name: str
) -> "pd.DataFrame":
    """Return the pairs in which both runs have a value of the metric. Columns: `kind`, `fault`, `first`,
    `second`.
    """
    import pandas as pd

    rows = [
        (p.row_a.kind, p.row_a.fault, a.metrics_by_id[p.a.id].get(name), b.metrics_by_id[p.b.id].get(name))
        for p in pairs
    ]
    return pd.DataFrame(rows, columns=["kind", "fault", "first", "second"]).dropna()


def _median_cells(frame: "pd.DataFrame") -> tuple[SheetCell, ...]:
    first, second = frame["first"], frame["second"]
    estimate = median_difference(first, second, frame["fault"])
    medians = (float(first.median()), float(second.median()))
    interval = (estimate.difference, estimate.low, estimate.high)
    return (len(frame), *medians, *interval, PValue(wilcoxon_p(first, second)))


def severity_cross_table(
    pairs: Sequence[ExperimentPair], names: RunDisplayNames, scale: SeverityScale | None
) -> Sheet:
    order = [*SEVERITY_CLASSES[::-1], ""]
    counts = Counter((p.row_a.severity, p.row_b.severity) for p in pairs if p.is_usable)
    classes = [name for name in order if any(name in pair for pair in counts)]
    return Sheet(
        name="severity",
        title="Severity",
        note=f"Rows: severity class in {names.a}. Columns: severity class in {names.b}."
        + describe_severity_classes(scale, classes),
        heads=(f"{names.a} / {names.b}", *(name or NO_CLASS for name in classes)),
        lines=tuple(
            (severity_class or NO_CLASS, *(counts[severity_class, other] for other in classes))
            for severity_class in classes
        )
        if any(classes)
        else (),
    )
