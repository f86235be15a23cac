"""The figures of a fault's values and of the times to hazards."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from mutator.figures import figure_style
from mutator.results.outcome_counting import families_or_scenarios_of
from mutator.statistics.event_time_statistics import share_of_hazards_within

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_SCENARIO_MARKERS = (
    "o",
    "s",
    "^",
    "D",
    "v",
    "P",
    "p",
)  # their number shares no factor with that of the colours
_SCENARIO_COLOURS = ("#0072b2", "#c04f00", "#007a5a", "#a8326f", "#8a5a00", "#5b4bb5")
_LIMIT_COLOUR = "#b00020"
LabelledLimits = Sequence[tuple[float, str]]


@figure_style.shipped_style()
def draw_values(
    points: "pd.DataFrame", *, title: str, x_label: str, y_label: str, limits: LabelledLimits
) -> "Figure":
    """Draw a mark for each row of `points`: `value` and `y`, with the scenario, or its family, as colour
    and shape, filled if `is_hazard`. Each of the `limits` is a height and its words.
    """
    figure, [axis] = figure_style.blank_figure(4.5, 1, 1)
    scenarios = families_or_scenarios_of(points)
    for number, (scenario, group) in enumerate(points.groupby(scenarios, sort=True, observed=True)):
        colour, marker = (
            _SCENARIO_COLOURS[number % len(_SCENARIO_COLOURS)],
            _SCENARIO_MARKERS[number % len(_SCENARIO_MARKERS)],
        )
        for is_hazard, part in group.groupby("is_hazard"):
            axis.plot(
                part["value"],
                part["y"],
                marker,
                markersize=6,
                color=colour,
                markerfacecolor=colour if is_hazard else "none",
                label=f"{scenario}{'' if is_hazard else ', no hazard'}",
            )
    for height, words in limits:
        axis.axhline(height, color=_LIMIT_COLOUR, linestyle="--", linewidth=1.2)
        axis.annotate(
            words,
            (1.0, height),
            xycoords=("axes fraction", "data"),
            xytext=(-3, 3),
            textcoords="offset points",
            ha="right",
            color=_LIMIT_COLOUR,
            fontsize=figure_style.SMALL_TEXT_POINTS,
        )
    _finish_axis(figure, axis, title, x_label, y_label)
    return figure


@figure_style.shipped_style()
def draw_times_to_hazard(
    frame: "pd.DataFrame", fault: "pd.DataFrame | None", reaction_time_s: float
) -> "Figure":
    """Draw the share of hazards that have come by each time from the activation: of all runs of a frame and,
    if given, of those of one `fault`; with a line at a reaction time and the shares there.
    """
    figure, [axis] = figure_style.blank_figure(4.0, 1, 1)
    parts = [("all faults", frame, "#5c6672", 2.5)]
    if fault is not None:
        parts.append(("this fault", fault, _SCENARIO_COLOURS[1], 1.6))
    latest = max(reaction_time_s, frame["time_to_hazard"].max(skipna=True) if len(frame) else 0.0, 0.1)
    for name, part, colour, width in parts:
        times = np.sort(part["time_to_hazard"].dropna().to_numpy())
        shares = 100 * np.arange(1, len(times) + 1) / max(1, len(times))
        label = f"{name}: {share_of_hazards_within(part, reaction_time_s)} within {reaction_time_s:g} s"
        axis.step(
            [0.0, *times, 1.05 * latest],
            [0.0, *shares, *shares[-1:]] if len(times) else [0.0, 0.0],
            where="post",
            color=colour,
            linewidth=width,
            label=label,
        )
    axis.axvline(reaction_time_s, color=figure_style.INK_COLOUR, linestyle="--", linewidth=1.2)
    axis.set_ylim(0, 104)
    axis.set_xlim(0, 1.05 * latest)
    _finish_axis(
        figure, axis, "How soon hazards come", "time from activation to hazard [s]", "share of hazards [%]"
    )
    return figure


def _finish_axis(figure: "Figure", axis: "Axes", title: str, x_label: str, y_label: str) -> None:
    axis.set_title(title, fontsize=figure_style.TEXT_POINTS, loc="left")
    axis.set_xlabel(x_label, fontsize=figure_style.TEXT_POINTS)
    axis.set_ylabel(y_label, fontsize=figure_style.TEXT_POINTS)
    axis.grid(visible=True, linewidth=0.4, alpha=0.5)
    axis.set_axisbelow(True)
    if axis.get_legend_handles_labels()[0]:
        figure.legend(
            loc="outside lower center", ncols=4, fontsize=figure_style.SMALL_TEXT_POINTS, frameon=False
        )
