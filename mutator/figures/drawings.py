"""Select the figures of a run by what can be compared, as SVG and PNG."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import pandas as pd

from mutator.figures import hazard_heat_map, hazards_by_fault_type, propagation_times
from mutator.figures.golden_and_faulty_plot import render_images
from mutator.statistics.results_frame import select_common_columns

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FIGURES_FOLDER, FIGURE_FORMATS = "figures", ("svg", "png")


@dataclass(frozen=True, slots=True, kw_only=True)
class Drawing:
    """One figure. `note` says what the figure shows, or why there is none. `codes` are lines of code to copy,
    each with a description.
    """

    name: str
    title: str
    note: str
    figure: "Figure | None"
    described_code_lines: tuple[tuple[str, str], ...] = ()

    def file_name(self, suffix: str) -> str:
        return f"{FIGURES_FOLDER}/{self.name}.{suffix}"


def draw_figures(frame: pd.DataFrame) -> tuple[Drawing, ...]:
    frame = select_common_columns(frame)
    kinds, scenarios = frame["kind"].nunique(), frame["scenario"].nunique()
    drawings = []
    if kinds > 1:
        drawings.append(_draw_hazards(frame))
    if scenarios > 1:
        drawings.append(_draw_propagation_times(frame))
    if kinds > 1 and scenarios > 1:
        drawings.append(_draw_hazard_heat_map(frame))
    return tuple(drawings)


def drawing_files(drawings: Sequence[Drawing]) -> dict[str, bytes]:
    """Return the figures as files, by name: each as SVG and PNG."""
    files: dict[str, bytes] = {}
    for drawing in drawings:
        if drawing.figure is not None:
            names = [drawing.file_name(suffix) for suffix in FIGURE_FORMATS]
            files |= dict(zip(names, render_images(drawing.figure, FIGURE_FORMATS), strict=True))
    return files


def _draw_hazards(frame: pd.DataFrame) -> Drawing:
    return Drawing(
        name="hazards_by_fault_type",
        title="Hazards by fault type",
        note="Left: runs with a hazard among all injected. Right: hazards as a share of activated faults. "
        "Fault types without a mark were never activated.",
        figure=hazards_by_fault_type.draw(frame),
    )


def _draw_propagation_times(frame: pd.DataFrame) -> Drawing:
    return Drawing(
        name="propagation_by_scenario",
        title="Propagation times by scenario",
        note="Times between two events, in runs with both (number above). Alert to hazard: "
        "only if the alert came first. Runs that ended before the second event are not shown.",
        figure=propagation_times.draw(frame),
    )


def _draw_hazard_heat_map(frame: pd.DataFrame) -> Drawing:
    return Drawing(
        name="fault_type_by_scenario",
        title="Fault type and scenario",
        note="Runs with a hazard / activated faults. 0/0 without colour: never activated. Empty: no run.",
        figure=hazard_heat_map.draw(frame),
    )
