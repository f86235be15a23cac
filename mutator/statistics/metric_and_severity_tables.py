"""Tables of metrics, severity classes and times to hazard."""

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from mutator.statistics.bootstrap_median_intervals import median_interval
from mutator.statistics.results_frame import select_common_columns
from mutator.statistics.sample_weights import WEIGHT_COLUMN
from mutator.statistics.statistics_sheet import Sheet, SheetCell
from mutator.statistics.weighted_shares import share_of_runs
from mutator.targets.hazard_severity import SEVERITY_CLASSES, SeverityScale
from mutator.targets.stored_target_facts import MetricFacts

if TYPE_CHECKING:
    import pandas as pd

HIGHER_IS_WORSE = "higher"
TOTAL = "total"
# the span whose shortest time is an upper bound of the FTTI: it has only runs whose fault acted to the hazard
FTTI_BOUND_SPAN = "activation to hazard, fault still active"
_INTERVAL_NOTE = (
    "The 95 % interval of a median comes from resampling whole faults (location and value); there is none if "
    "all runs agree."
)


def metrics_sheet(frame: "pd.DataFrame", metrics: Sequence[MetricFacts]) -> Sheet:
    """Tabulate the spread of each metric. Without values, the table has no lines."""
    lines: list[tuple[SheetCell, ...]] = []
    activated = frame.loc[frame["is_activated"], ["kind", "fault_id", *(metric.name for metric in metrics)]]
    for metric in metrics:
        column = (metric.name, metric.unit, metric.worse)
        for kind, values, faults in _values_by_fault_type(activated, activated[metric.name]):
            is_higher = metric.worse == HIGHER_IS_WORSE
            bad = float(values.quantile(0.75 if is_higher else 0.25))
            worst = float(values.max() if is_higher else values.min())
            lines.append((kind, *column, len(values), *_median_cells(values, faults), bad, worst))
    return Sheet(
        name="metrics",
        title="Metrics by fault type",
        note="N: the runs in which the fault was activated and the metric has a value. Metrics cover a run "
        f"up to the end of the drive. {_INTERVAL_NOTE} A quarter of the runs are at least as bad as the "
        "worse quartile.",
        heads=(
            *("fault type", "metric", "unit", "worse", "N"),
            *("median", "median, low", "median, high", "worse quartile", "worst"),
        ),
        lines=tuple(lines),
    )


def describe_severity_classes(scale: SeverityScale | None, names: Sequence[str]) -> str:
    """Return a sentence with the classes in words, to append to a note; empty without a scale."""
    labels = [scale.labels[name] for name in names if name] if scale else []
    return f" Severity classes: {', '.join(labels)}." if labels else ""


def severity_by_fault_type_sheet(frame: "pd.DataFrame", scale_for_note: SeverityScale | None = None) -> Sheet:
    """Return the shares of activated faults in each severity class, by fault type; no lines without classes.

    With a scale, the note gives the classes in words.
    """
    lines: list[tuple[SheetCell, ...]] = []
    columns = [name for name in ("kind", "severity", "fault_id", WEIGHT_COLUMN) if name in frame]
    activated = frame.loc[frame["is_activated"], columns]
    for kind, group in _runs_by_fault_type(activated) if "severity" in frame else ():
        of_class = [group["severity"] == name for name in SEVERITY_CLASSES]
        any_class = group["severity"].isin(SEVERITY_CLASSES)
        shares = [share_of_runs(group, flags, flags | True) for flags in (any_class, *of_class)]
        lines.append((kind, *shares))
    return Sheet(
        name="severity",
        title="Severity by fault type",
        note="Activated faults with a hazard that has a severity class, in total and by class. 95 % "
        "Wilson intervals; in brackets, the count and the total."
        + describe_severity_classes(scale_for_note, SEVERITY_CLASSES),
        heads=("fault type", "any class", *SEVERITY_CLASSES),
        lines=tuple(lines),
    )


def times_to_hazard_sheet(
    frame: "pd.DataFrame", was_active_at_hazard: "pd.Series", *, has_alerts: bool = True
) -> Sheet:
    """Tabulate the times to the first hazard. `was_active_at_hazard` says for each row whether the fault
    still acted then. Without a hazard, the table has no lines.
    """
    with_hazard = select_common_columns(frame)[frame["is_hazard"]]
    since_activation, since_manifestation, since_alert = (
        (with_hazard["t_hazard"] - with_hazard[column]).round(6)
        for column in ("t_activation", "t_manifest", "t_alert")
    )
    spans = {
        "activation to hazard": since_activation,
        FTTI_BOUND_SPAN: since_activation.where(was_active_at_hazard[with_hazard.index]),
        "manifestation to hazard": since_manifestation.where(since_manifestation >= 0),
    }
    if has_alerts:
        spans["alert to hazard"] = since_alert.where(since_alert > 0)
    lines: list[tuple[SheetCell, ...]] = []
    for span, times in spans.items():
        for kind, values, faults in _values_by_fault_type(with_hazard, times):
            least, lower = float(values.min()), float(values.quantile(0.25))
            lines.append((kind, span, len(values), least, lower, *_median_cells(values, faults)))
    return Sheet(
        name="times_to_hazard",
        title="From fault to hazard by fault type",
        note="Time in s to the first hazard from activation, from the first difference of an actuator, and "
        "from the first alert, in the N runs with this order of events. A fault can have ended before the "
        f"hazard. The shortest time under *{FTTI_BOUND_SPAN}* is an upper bound of the fault tolerant time "
        "interval (FTTI) of the hazard that came first in that run: an FTTI belongs to one hazardous event, "
        "but each line, also the total, covers all hazards. These runs are a sample, and others can reach "
        "a hazard sooner; runs in which an alert came or a safety mechanism acted are included; and a "
        "hazard, such as a contact, can be later than the hazardous event. "
        f"{_INTERVAL_NOTE}",
        heads=(
            *("fault type", "time", "N", "shortest, s", "lower quartile, s"),
            *("median, s", "median, low, s", "median, high, s"),
        ),
        lines=tuple(lines),
    )


def _values_by_fault_type(
    frame: "pd.DataFrame", values: "pd.Series"
) -> Iterator[tuple[str, "pd.Series", "pd.Series"]]:
    """Yield each fault type with the values of its runs and the faults that they belong to. Runs without a
    value are left out.
    """
    present = values.dropna()
    for kind, group in _runs_by_fault_type(frame.loc[present.index, ["kind", "fault_id"]]):
        yield kind, present[group.index], group["fault_id"]


def _runs_by_fault_type(frame: "pd.DataFrame") -> Iterator[tuple[str, "pd.DataFrame"]]:
    """Yield the runs of each fault type and, if there are several types, all runs."""
    kinds = [(str(kind), group) for kind, group in frame.groupby("kind")]
    yield from kinds
    if len(kinds) > 1:
        yield TOTAL, frame


def _median_cells(values: "pd.Series", faults: "pd.Series") -> tuple[float, float, float]:
    low, high = median_interval(values, faults) if len(values) > 1 else (math.nan, math.nan)
    return float(values.median()), low, high
