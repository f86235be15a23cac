"""The figure of fault type by scenario, which shows where hazards occur."""

from typing import TYPE_CHECKING

import pandas as pd

from mutator.figures import style
from mutator.statistics.tallies import tally_of_runs

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.image import AxesImage

COLOURS = "cividis"  # perceptually uniform, also for colour-blind people
DARK_BELOW = 50.0  # %; text is white on cells below this rate, else black


@style.shipped_style()
def draw(frame: pd.DataFrame) -> "Figure":
    kinds, scenarios = sorted(frame["kind"].unique()), sorted(frame["scenario"].unique())
    methods = sorted(frame["method"].unique())
    figure, axes = style.blank(1.3 + 0.36 * len(kinds), 1, len(methods), sharey=True)
    for axis, method in zip(axes, methods, strict=True):
        image = _panel(axis, frame[frame["method"] == method], kinds, scenarios)
        axis.set_title(str(method), fontsize=style.TEXT, loc="left")
    axes[0].set_yticks(range(len(kinds)), kinds)
    bar = figure.colorbar(image, ax=axes, fraction=0.03, pad=0.02)
    bar.set_label("hazards per activated fault, %", fontsize=style.TEXT)
    bar.ax.tick_params(labelsize=style.SMALL)
    return figure


def _panel(axis: "Axes", frame: pd.DataFrame, kinds: list[str], scenarios: list[str]) -> "AxesImage":
    import numpy as np

    groups = {(str(k), str(s)): tally_of_runs(group) for (k, s), group in frame.groupby(["kind", "scenario"])}
    rates = np.full((len(kinds), len(scenarios)), np.nan)
    for (kind, scenario), found in groups.items():
        place = kinds.index(kind), scenarios.index(scenario)
        if found.activated:
            rates[place] = 100 * found.hazards / found.activated
        axis.text(
            place[1],
            place[0],
            f"{found.hazards}/{found.activated}",
            ha="center",
            va="center",
            fontsize=style.SMALL,
            color=_text_colour(rates[place]),
        )
    axis.set_xticks(range(len(scenarios)), scenarios)
    axis.spines[:].set_visible(False)
    return axis.imshow(rates, cmap=COLOURS, vmin=0, vmax=100, aspect="auto")


def _text_colour(rate: float) -> str:
    """Return the text colour for a cell with this rate; NaN: a cell without colour."""
    if rate != rate:
        return "black"
    return "white" if rate < DARK_BELOW else "#010101"  # not pure black, which follows the theme
