"""The map of fault type and scenario over all experiments, for pages that list only the worst. The measures
have the same names as in web/report/heat.js.
"""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import pandas as pd

from mutator.report.reported_run import ReportedRun
from mutator.statistics.results_frame import hazard_names
from mutator.targets.contact_severity import SEVERITY_CLASSES

Cells = list[list[Any]]  # by row; each cell has a count or value, and its base (the number of runs)


def map_of(run: ReportedRun) -> dict[str, Any]:
    """Return the fault types, scenarios, and cells by measure. The last row and column are totals."""
    frame = run.frame
    kinds, scenarios = (sorted(map(str, frame[name].unique())) for name in ("kind", "scenario"))
    named = (("kind", kinds), ("scenario", scenarios))
    y, x = (pd.Categorical(frame[name], categories=of).codes.astype(np.int64) for name, of in named)
    shape = (len(kinds) + 1, len(scenarios) + 1)
    cells: dict[str, Cells] = {}
    for name, part, of in _shares(frame, alerts=run.folder.has_alerts):
        cells[name] = _pairs(_counted(y, x, part & of, shape), _counted(y, x, of, shape))
    active = frame["is_activated"].to_numpy(dtype=bool)
    for metric in run.folder.head.metrics:
        values = frame[metric.name].to_numpy(dtype=float)
        known = active & ~np.isnan(values)
        cells |= _summaries(metric.name, metric.worse, values[known], y[known], x[known], shape)
    return {"kinds": kinds, "scenarios": scenarios, "cells": cells}


def _shares(frame: pd.DataFrame, *, alerts: bool) -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
    """Yield the name of each share, the rows that it counts, and the rows in its base."""

    def flag(name: str) -> np.ndarray:
        return frame[name].to_numpy(dtype=bool)

    active, hazard = flag("is_activated"), flag("is_hazard")
    every = np.ones(len(frame), dtype=bool)
    yield "hazards", hazard, active
    yield "hazards-injected", hazard, every
    yield "activated", active, every
    yield "manifested", flag("is_manifested"), active
    if alerts:
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


def _counted(y: np.ndarray, x: np.ndarray, rows: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    inner = (shape[0] - 1) * (shape[1] - 1)
    found = np.zeros(shape, dtype=np.int64)
    counts = np.bincount((y * (shape[1] - 1) + x)[rows], minlength=inner)
    found[:-1, :-1] = counts.reshape(shape[0] - 1, shape[1] - 1)
    found[-1] = found.sum(axis=0)
    found[:, -1] = found.sum(axis=1)
    return found


def _pairs(part: np.ndarray, of: np.ndarray) -> Cells:
    return [list(map(int, pair)) for pair in zip(part.ravel(), of.ravel(), strict=True)]


def _summaries(
    name: str, worse: str, values: np.ndarray, y: np.ndarray, x: np.ndarray, shape: tuple[int, int]
) -> Mapping[str, Cells]:
    medians: Cells = []
    worsts: Cells = []
    for row in range(shape[0]):
        in_row = np.ones(len(values), dtype=bool) if row == shape[0] - 1 else y == row
        for column in range(shape[1]):
            some = values[in_row if column == shape[1] - 1 else in_row & (x == column)]
            medians.append([_number(np.median(some)) if some.size else None, int(some.size)])
            worst = (some.max() if worse == "higher" else some.min()) if some.size else None
            worsts.append([None if worst is None else _number(worst), int(some.size)])
    return {f"median-{name}": medians, f"worst-{name}": worsts}


def _number(value: np.floating[Any]) -> float | None:
    return float(f"{value:.6g}") if np.isfinite(value) else None
