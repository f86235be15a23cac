"""The figure of the times between the events of a fault, by scenario."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from mutator.figures import figure_style
from mutator.results.outcome_counting import families_or_scenarios_of
from mutator.statistics.event_time_statistics import TimeSpread, propagation_spreads_by_step

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@figure_style.shipped_style()
def draw_times_by_scenario(frame: "pd.DataFrame") -> "Figure":
    names = families_or_scenarios_of(frame)
    methods, scenarios = sorted(frame["method"].unique()), sorted(names.unique())
    spreads = {
        (m, s): propagation_spreads_by_step(group) for (m, s), group in frame.groupby(["method", names])
    }
    steps = list(next(iter(spreads.values())))
    figure, axes = figure_style.blank_figure(6.2, 2, 2)
    for axis, step in zip(axes, steps, strict=True):
        for m, method in enumerate(methods):
            offset = 0.36 * (m - (len(methods) - 1) / 2)  # side by side, centred on the scenario
            spread_by_x = [(i + offset, spreads.get((method, s))) for i, s in enumerate(scenarios)]
            _draw_method(axis, [(x, spread[step]) for x, spread in spread_by_x if spread], str(method))
        axis.set_title(step, fontsize=figure_style.TEXT_POINTS, loc="left")
        axis.set_xticks(range(len(scenarios)), scenarios)
        axis.set_xlim(-0.6, len(scenarios) - 0.4)
        axis.set_ylabel("s", fontsize=figure_style.TEXT_POINTS)
        top = axis.dataLim.y1 if axis.has_data() else 1.0
        axis.set_ylim(0, 1.2 * max(top, 0.01))
        axis.grid(visible=True, axis="y", linewidth=0.4, alpha=0.5)
        axis.set_axisbelow(True)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(
        handles,
        labels,
        loc="outside lower center",
        ncols=6,
        fontsize=figure_style.SMALL_TEXT_POINTS,
        frameon=False,
    )
    return figure


def _draw_method(axis: "Axes", spreads: Sequence[tuple[float, TimeSpread]], method: str) -> None:
    colour, marker = figure_style.colour_and_marker(method)
    with_runs = [(x, spread) for x, spread in spreads if spread.time_count]
    xs = [x for x, _ in with_runs]
    lower = [s.lower_quartile for _, s in with_runs]
    upper = [s.upper_quartile for _, s in with_runs]
    height = [b - a for a, b in zip(lower, upper, strict=True)]
    axis.bar(
        xs, height, 0.28, lower, color=colour, alpha=0.35, edgecolor=colour, label=f"{method}: quartiles"
    )
    medians = [s.median for _, s in with_runs]
    axis.plot(xs, medians, "_", color=colour, markersize=17, markeredgewidth=2.2, label=f"{method}: median")
    means = [s.mean for _, s in with_runs]
    axis.plot(
        xs,
        means,
        marker,
        color=figure_style.INK_COLOUR,
        markersize=4,
        label=f"{method}: mean",
        linestyle="none",
    )
    for x, s in with_runs:
        axis.annotate(
            str(s.time_count),
            (x, max(s.upper_quartile, s.mean)),
            xytext=(0, 4),
            textcoords="offset points",
            ha="center",
            fontsize=figure_style.SMALL_TEXT_POINTS,
        )
