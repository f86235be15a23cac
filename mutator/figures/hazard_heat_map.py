"""The figure of fault type by scenario, which shows where hazards occur."""

from typing import TYPE_CHECKING

import pandas as pd

from mutator.figures import style
from mutator.statistics.tallies import tally_of_runs

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.image import AxesImage

COLOUR_MAP = "cividis"  # perceptually uniform, also for colour-blind people
WHITE_TEXT_BELOW_PERCENT = 50.0  # %; text is white on cells below this rate, else black


@style.shipped_style()
def draw(frame: pd.DataFrame) -> "Figure":
    kinds, scenarios = sorted(frame["kind"].unique()), sorted(frame["scenario"].unique())
    methods = sorted(frame["method"].unique())
    figure, axes = style.blank_figure(1.3 + 0.36 * len(kinds), 1, len(methods), sharey=True)
    for axis, method in zip(axes, methods, strict=True):
        image = _draw_method(axis, frame[frame["method"] == method], kinds, scenarios)
        axis.set_title(str(method), fontsize=style.TEXT_POINTS, loc="left")
    axes[0].set_yticks(range(len(kinds)), kinds)
    bar = figure.colorbar(image, ax=axes, fraction=0.03, pad=0.02)
    bar.set_label("hazards per activated fault, %", fontsize=style.TEXT_POINTS)
    bar.ax.tick_params(labelsize=style.SMALL_TEXT_POINTS)
    return figure


def _draw_method(axis: "Axes", frame: pd.DataFrame, kinds: list[str], scenarios: list[str]) -> "AxesImage":
    import numpy as np

    groups = frame.groupby(["kind", "scenario"])
    tallies = {(str(k), str(s)): tally_of_runs(group) for (k, s), group in groups}
    rates = np.full((len(kinds), len(scenarios)), np.nan)
    for (kind, scenario), cell_tally in tallies.items():
        place = kinds.index(kind), scenarios.index(scenario)
        if cell_tally.activated:
            rates[place] = 100 * cell_tally.hazards / cell_tally.activated
        axis.text(
            place[1],
            place[0],
            f"{cell_tally.hazards}/{cell_tally.activated}",
            ha="center",
            va="center",
            fontsize=style.SMALL_TEXT_POINTS,
            color=_text_colour(rates[place]),
        )
    axis.set_xticks(range(len(scenarios)), scenarios)
    axis.spines[:].set_visible(False)
    return axis.imshow(rates, cmap=COLOUR_MAP, vmin=0, vmax=100, aspect="auto")


def _text_colour(rate: float) -> str:
    """Return the text colour for a cell with this rate; NaN: a cell without colour."""
    if rate != rate:
        return "black"
    return (
        "white" if rate < WHITE_TEXT_BELOW_PERCENT else "#010101"
    )  # not pure black, which follows the theme
