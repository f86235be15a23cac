"""Select the figures of a run by what can be compared, as SVG and PNG."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from mutator.figures import propagation_time_figure
from mutator.figures.golden_and_faulty_plot import render_images
from mutator.results.outcome_counting import families_or_scenarios_of
from mutator.statistics.results_frame import select_common_columns

if TYPE_CHECKING:
    import pandas as pd
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


def draw_figures(frame: "pd.DataFrame") -> tuple[Drawing, ...]:
    """Return the figures that show what no part of the report's page shows; empty without a comparison."""
    frame = select_common_columns(frame)
    return (_draw_propagation_times(frame),) if families_or_scenarios_of(frame).nunique() > 1 else ()


def drawing_files(drawings: Sequence[Drawing]) -> dict[str, bytes]:
    """Return the figures as files, by name: each as SVG and PNG."""
    files: dict[str, bytes] = {}
    for drawing in drawings:
        if drawing.figure is not None:
            names = [drawing.file_name(suffix) for suffix in FIGURE_FORMATS]
            files |= dict(zip(names, render_images(drawing.figure, FIGURE_FORMATS), strict=True))
    return files


def _draw_propagation_times(frame: "pd.DataFrame") -> Drawing:
    return Drawing(
        name="propagation_by_scenario",
        title="Propagation times by scenario",
        note="Times between two events, in runs with both (number above). Alert to hazard: "
        "only if the alert came first. Runs that ended before the second event are not shown.",
        figure=propagation_time_figure.draw_times_by_scenario(frame),
    )
