"""Tables of metrics, severity classes and times to hazard."""

import math
from collections.abc import Iterator, Sequence

import pandas as pd

from mutator.statistics.median_intervals import median_interval
from mutator.statistics.results_frame import select_common_columns
from mutator.statistics.shares import share
from mutator.statistics.statistics_sheet import Sheet, SheetCell
from mutator.targets.contact_severity import SEVERITY_CLASSES
from mutator.targets.stored_target_facts import MetricFacts

HIGHER_IS_WORSE = "higher"
TOTAL = "total"
_INTERVAL_NOTE = (
    "The 95 % interval of a median comes from resampling whole faults (location and value); there is none if "
    "all runs agree."
)


def metrics_sheet(frame: pd.DataFrame, metrics: Sequence[MetricFacts]) -> Sheet:
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


def severity_sheet(frame: pd.DataFrame) -> Sheet:
    """Return the table of activated faults by severity class. Without classes, it has no lines."""
    lines: list[tuple[SheetCell, ...]] = []
    columns = [name for name in ("kind", "severity") if name in frame]
    activated = frame.loc[frame["is_activated"], columns]
    for kind, group in _runs_by_fault_type(activated) if "severity" in frame else ():
        counts = [int((group["severity"] == name).sum()) for name in SEVERITY_CLASSES]
        shares = [share(count, len(group)) for count in (sum(counts), *counts)]
        lines.append((kind, *shares))
    return Sheet(
        name="severity",
        title="Severity by fault type",
        note="Activated faults whose drive ended in a contact, in total and by class. 95 % "
        "Wilson intervals; in brackets, the count and the total. Hazards without a contact have no class.",
        heads=("fault type", "contact", *SEVERITY_CLASSES),
        lines=tuple(lines),
    )


def fault_tolerant_times_sheet(frame: pd.DataFrame, *, has_alerts: bool = True) -> Sheet:
    with_hazard = select_common_columns(frame)[frame["is_hazard"]]
    starts = {"activation": "t_activation", "manifestation": "t_manifest"}
    starts |= {"alert": "t_alert"} if has_alerts else {}
    lines: list[tuple[SheetCell, ...]] = []
    for start, column in starts.items():
        times = (with_hazard["t_hazard"] - with_hazard[column]).round(6)
        is_in_order = times > 0 if start == "alert" else times >= 0
        for kind, values, faults in _values_by_fault_type(with_hazard, times.where(is_in_order)):
            least, lower = float(values.min()), float(values.quantile(0.25))
            lines.append(
                (kind, f"{start} to hazard", len(values), least, lower, *_median_cells(values, faults))
            )
    return Sheet(
        name="fault_tolerant_times",
        title="From fault to hazard by fault type",
        note="Time in s to the first hazard from activation (the fault-tolerant time), from the first "
        "difference of an actuator, and from the first alert, in the N runs with this order of events. "
        f"Fault detection and reaction must fit into the shortest time. {_INTERVAL_NOTE}",
        heads=(
            *("fault type", "time", "N", "shortest, s", "lower quartile, s"),
            *("median, s", "median, low, s", "median, high, s"),
        ),
        lines=tuple(lines),
    )


def _values_by_fault_type(
    frame: pd.DataFrame, values: pd.Series
) -> Iterator[tuple[str, pd.Series, pd.Series]]:
    """Yield each fault type with the values of its runs and the faults that they belong to. Runs without a
    value are left out.
    """
    present = values.dropna()
    for kind, group in _runs_by_fault_type(frame.loc[present.index, ["kind", "fault_id"]]):
        yield kind, present[group.index], group["fault_id"]


def _runs_by_fault_type(frame: pd.DataFrame) -> Iterator[tuple[str, pd.DataFrame]]:
    """Yield the runs of each fault type and, if there are several types, all runs."""
    kinds = [(str(kind), group) for kind, group in frame.groupby("kind")]
    yield from kinds
    if len(kinds) > 1:
        yield TOTAL, frame


def _median_cells(values: pd.Series, faults: pd.Series) -> tuple[float, float, float]:
    low, high = median_interval(values, faults) if len(values) > 1 else (math.nan, math.nan)
    return float(values.median()), low, high
