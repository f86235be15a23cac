"""The figure of hazards by fault type: counts by hazard, and shares of activated faults."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from mutator.figures import style
from mutator.statistics.results_frame import hazard_names
from mutator.statistics.shares import share
from mutator.statistics.tallies import Tally, tally_by_fault_type

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SEVERAL_HAZARDS = "several"


def hazard_labels(frame: pd.DataFrame) -> pd.Series:
    """Return each run's hazard, `several` if it has more than one, or '' if it has none."""
    names = hazard_names(frame)
    has_hazard = frame[[f"t_{name.lower()}" for name in names]].notna().to_numpy()
    count = has_hazard.sum(axis=1)
    labels = np.array([*names, "", SEVERAL_HAZARDS], dtype=object)[
        np.where(count > 1, -1, np.where(count == 1, has_hazard.argmax(axis=1), -2))
    ]
    return pd.Series(labels, index=frame.index, dtype=str)


@style.shipped_style()
def draw(frame: pd.DataFrame) -> "Figure":
    tallies = tally_by_fault_type(frame)
    methods = sorted({method for method, _ in tallies})
    hazards = frame.groupby("kind")["is_hazard"].sum()
    kinds = sorted(hazards.index, key=lambda kind: (-hazards[kind], kind))
    figure, axes = style.blank_figure(1.5 + 0.33 * len(kinds), 1, len(methods) + 1, sharey=True)
    most = max(1, *(tallies[key].hazards for key in tallies))
    for axis, method in zip(axes, methods, strict=False):
        _draw_counts(axis, frame[frame["method"] == method], kinds)
        axis.set_title(f"{method}: runs with a hazard", fontsize=style.TEXT_POINTS, loc="left")
        axis.set_xlim(0, 1.3 * most)
    axes[0].set_yticks(range(len(kinds)), kinds)
    axes[0].set_ylim(len(kinds) - 0.4, -0.6)
    _draw_hazard_shares(axes[-1], tallies, methods, kinds)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(
        handles, labels, loc="outside lower left", ncols=6, fontsize=style.SMALL_TEXT_POINTS, frameon=False
    )
    handles, labels = axes[-1].get_legend_handles_labels()
    figure.legend(
        handles, labels, loc="outside lower right", ncols=4, fontsize=style.SMALL_TEXT_POINTS, frameon=False
    )
    return figure


def _draw_counts(axis: "Axes", frame: pd.DataFrame, kinds: list[str]) -> None:
    names = hazard_names(frame)
    counts = pd.crosstab(frame["kind"], hazard_labels(frame)).reindex(kinds, fill_value=0)
    injected = frame["kind"].value_counts().reindex(kinds, fill_value=0)
    bar_starts = [0] * len(kinds)
    for i, name in enumerate((*names, SEVERAL_HAZARDS)):
        colour = (
            style.SEVERAL_COLOUR
            if name == SEVERAL_HAZARDS
            else style.HAZARD_COLOURS[i % len(style.HAZARD_COLOURS)]
        )
        width = counts[name].tolist() if name in counts else [0] * len(kinds)
        label = "more than one" if name == SEVERAL_HAZARDS else f"{name} alone"
        axis.barh(
            range(len(kinds)),
            width,
            0.7,
            bar_starts,
            color=colour,
            edgecolor=style.INK_COLOUR,
            linewidth=0.5,
            label=label,
        )
        bar_starts = [a + b for a, b in zip(bar_starts, width, strict=True)]
    for i, (count, of) in enumerate(zip(bar_starts, injected, strict=True)):
        axis.annotate(
            f"{count} of {of}",
            (count, i),
            xytext=(4, 0),
            textcoords="offset points",
            va="center",
            fontsize=style.SMALL_TEXT_POINTS,
        )
    axis.locator_params(axis="x", integer=True)
    axis.set_xlabel("runs", fontsize=style.TEXT_POINTS)


def _draw_hazard_shares(
    axis: "Axes", tallies: dict[tuple[str, str], Tally], methods: Sequence[str], kinds: Sequence[str]
) -> None:
    for m, method in enumerate(methods):
        colour, marker = style.colour_and_marker(method)
        height = 0.18 * (2 * m - len(methods) + 1)  # methods side by side, centred on the row
        tally_by_row = [
            (i, tallies[method, kind]) for i, kind in enumerate(kinds) if (method, kind) in tallies
        ]
        shares = [(i + height, share(t.hazards, t.activated)) for i, t in tally_by_row if t.activated]
        rates = [100 * s.rate for _, s in shares]
        ends = [
            [max(0.0, 100 * (s.rate - s.low)) for _, s in shares],
            [max(0.0, 100 * (s.high - s.rate)) for _, s in shares],
        ]
        axis.errorbar(
            rates,
            [y for y, _ in shares],
            xerr=ends,
            fmt=marker,
            color=colour,
            markersize=4,
            elinewidth=1.2,
            label=method,
        )
    axis.set_title("hazards per activated fault", fontsize=style.TEXT_POINTS, loc="left")
    axis.set_xlim(-3, 103)
    axis.set_xlabel("% (95 % Wilson interval)", fontsize=style.TEXT_POINTS)
    axis.grid(visible=True, linewidth=0.4, alpha=0.5)
    axis.set_axisbelow(True)
