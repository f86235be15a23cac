"""How bad runs were: the target's metrics as a table."""

from collections.abc import Sequence

import pandas as pd

from mutator.statistics.sheet import Cell, Sheet

HIGHER = "higher"


def metrics_sheet(frame: pd.DataFrame, metrics: Sequence[Sequence[str]]) -> Sheet:
    """Of each metric (name, unit, meaning, which way is worse) the spread over the activated faults, by fault
    type; without lines where no run has a value."""
    lines: list[tuple[Cell, ...]] = []
    activated = frame[frame["is_activated"]]
    for name, unit, _, worse in metrics:
        values = pd.to_numeric(activated[name]).dropna()
        for kind, group in values.groupby(activated["kind"]):
            is_higher = worse == HIGHER
            bad = float(group.quantile(0.75 if is_higher else 0.25))
            worst = float(group.max() if is_higher else group.min())
            lines.append((str(kind), name, unit, worse, len(group), float(group.median()), bad, worst))
    return Sheet(
        name="metrics",
        title="Metrics by fault type",
        note="Over the N runs with an activated fault that have a value, up to the end of the drive. A "
        "quarter of them is at the worse quartile or beyond.",
        heads=("fault type", "metric", "unit", "worse", "N", "median", "worse quartile", "worst"),
        lines=tuple(lines),
    )
