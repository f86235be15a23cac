"""The map of fault type and scenario over all experiments, for pages that list only the worst. The measures
have the same names as in web/report/heat.js.
"""

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from mutator.report.reported_run import ReportedRun
from mutator.results.outcome_counting import families_or_scenarios_of
from mutator.statistics.results_frame import hazard_names
from mutator.statistics.shares_with_intervals import CONFIDENCE_LEVEL
from mutator.targets.hazard_severity import SEVERITY_CLASSES

if TYPE_CHECKING:
    import pandas as pd

HeatMapCells = list[list[Any]]  # by row; each cell has a count or value, and its base (the number of runs)


def build_heat_map(run: ReportedRun) -> dict[str, Any]:
    """Return the fault types, scenarios (those of a family are one), and cells by measure. The last row and
    column are totals.
    """
    import pandas as pd

    frame = run.frame
    columns = (frame["kind"], families_or_scenarios_of(frame))
    kinds, scenarios = (sorted(map(str, column.unique())) for column in columns)
    y, x = (
        pd.Categorical(column, categories=names).codes.astype(np.int64)
        for column, names in zip(columns, (kinds, scenarios), strict=True)
    )
    shape = (len(kinds) + 1, len(scenarios) + 1)
    cells: dict[str, HeatMapCells] = {}
    for name, part, of in _share_and_base_row_masks(frame, has_alerts=run.folder.has_alerts):
        cells[name] = _count_and_base_cells(
            _count_cells(y, x, part & of, shape), _count_cells(y, x, of, shape)
        )
    active = frame["is_activated"].to_numpy(dtype=bool)
    for metric in run.folder.head.metrics:
        values = frame[metric.name].to_numpy(dtype=float)
        has_value = active & ~np.isnan(values)
        cells |= _median_and_worst_cells(
            metric.name, metric.worse, values[has_value], y[has_value], x[has_value], shape
        )
    return {"kinds": kinds, "scenarios": scenarios, "cells": cells}


def _share_and_base_row_masks(
    frame: "pd.DataFrame", *, has_alerts: bool
) -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
    """Yield the name of each share, the rows that it counts, and the rows in its base."""
    import pandas as pd

    def flags(name: str) -> np.ndarray:
        return frame[name].to_numpy(dtype=bool)

    active, hazard = flags("is_activated"), flags("is_hazard")
    every = np.ones(len(frame), dtype=bool)
    yield "hazards", hazard, active
    yield "hazards-injected", hazard, every
    yield "activated", active, every
    yield "manifested", flags("is_manifested"), active
    if has_alerts:
        alert = (frame["alerts"] != "").to_numpy()
        yield "alerts", alert, active
        yield "silent", frame["reaction_time"].isna().to_numpy(), hazard
        yield "no-alert", ~alert, hazard
    for name in hazard_names(frame):
        yield name, frame[f"t_{name.lower()}"].notna().to_numpy(), active
    if "severity" in frame:
        worst = pd.Index(SEVERITY_CLASSES).get_indexer(pd.Index(frame["severity"]))
        for place, name in enumerate(SEVERITY_CLASSES):
            yield f"severity-{name}", worst >= place, active


def _count_cells(y: np.ndarray, x: np.ndarray, row_mask: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    inner = (shape[0] - 1) * (shape[1] - 1)
    with_totals = np.zeros(shape, dtype=np.int64)
    counts = np.bincount((y * (shape[1] - 1) + x)[row_mask], minlength=inner)
    with_totals[:-1, :-1] = counts.reshape(shape[0] - 1, shape[1] - 1)
    with_totals[-1] = with_totals.sum(axis=0)
    with_totals[:, -1] = with_totals.sum(axis=1)
    return with_totals


def _count_and_base_cells(part: np.ndarray, whole: np.ndarray) -> HeatMapCells:
    return [list(map(int, pair)) for pair in zip(part.ravel(), whole.ravel(), strict=True)]


def _median_and_worst_cells(
    name: str, worse: str, values: np.ndarray, y: np.ndarray, x: np.ndarray, shape: tuple[int, int]
) -> Mapping[str, HeatMapCells]:
    medians: HeatMapCells = []
    worsts: HeatMapCells = []
    for row in range(shape[0]):
        in_row = np.ones(len(values), dtype=bool) if row == shape[0] - 1 else y == row
        for column in range(shape[1]):
            cell_values = np.sort(values[in_row if column == shape[1] - 1 else in_row & (x == column)])
            medians.append([*_median_and_count(cell_values), *_median_bounds(cell_values)])
            worst = (
                (cell_values.max() if worse == "higher" else cell_values.min()) if cell_values.size else None
            )
            worsts.append([None if worst is None else _rounded(worst), int(cell_values.size)])
    return {f"median-{name}": medians, f"worst-{name}": worsts}


def _median_and_count(sorted_values: np.ndarray) -> tuple[float | None, int]:
    return (_rounded(np.median(sorted_values)) if sorted_values.size else None), int(sorted_values.size)


def _median_bounds(sorted_values: np.ndarray) -> list[float | None]:
    """Return the ends of the 95 % interval of the median from order statistics, as in heat.js; empty if there
    are too few values.
    """
    from scipy.stats import binom  # type: ignore[import-untyped]

    rank = int(binom.ppf((1 - CONFIDENCE_LEVEL) / 2, sorted_values.size, 0.5)) if sorted_values.size else 0
    return [_rounded(sorted_values[rank - 1]), _rounded(sorted_values[-rank])] if rank else []


def _rounded(value: np.floating[Any]) -> float | None:
    return float(f"{value:.6g}") if np.isfinite(value) else None
