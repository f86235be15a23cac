"""Draws a golden run (dashed) and a faulty run (solid) on one time axis, with marked events."""

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from mutator.figures import style
from mutator.figures.run_plot import (
    FAULTY_COLOUR,
    GOLDEN_COLOUR,
    MARK_COLOURS,
    MARK_LINES,
    Mark,
    MarkKind,
    finite,
)
from mutator.paper.unsafe_actions import Pair, Steps, Wanted
from mutator.targets.manifest import TargetManifest

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BEFORE_S, AFTER_S = 4.0, 1.0  # time that is shown before activation and after the hazard
SHADE = "#bbbbbb"
LEAST_RANGE = 0.1  # minimum range of a vertical axis; less would magnify noise
LABEL_SHARE = 0.12  # width of a mark's label as a share of the time axis


@style.shipped_style()
def draw(
    pair: Pair, steps: Steps, wanted: Wanted, marks: Iterable[Mark], manifest: TargetManifest
) -> "Figure":
    """Draw the `wanted.panels` that both runs have. In those of `wanted.actions`, shade `steps`."""
    units = {channel.name: channel.unit for channel in (*manifest.compared, *manifest.plotted)}
    panels = [(c, what) for c, what in wanted.panels if c in pair.golden and c in pair.faulty]
    first = max(float(pair.t[0]), pair.start - BEFORE_S)
    last = min(float(pair.t[-1]), pair.end + AFTER_S)
    figure, axes = style.blank(1.1 + 1.35 * len(panels), len(panels), 1)
    shown = (pair.t >= first) & (pair.t <= last)
    for axis, (channel, what) in zip(axes, panels, strict=True):
        _lines(axis, pair, channel, shown)
        axis.set_ylabel(f"{what} [{units.get(channel) or '-'}]", fontsize=style.TEXT)
        axis.set_xlim(first, last)
        if channel in wanted.actions:
            _shade(axis, pair.t, steps)
        low, high = axis.get_ylim()
        axis.set_ylim(low, max(high, low + LEAST_RANGE))
        axis.tick_params(labelbottom=axis is axes[-1])
    axes[-1].set_xlabel("time [s]", fontsize=style.TEXT)
    _mark(axes, [mark for mark in first_ones(marks) if first <= mark.t <= last], last - first)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower left", ncols=2, fontsize=style.SMALL, frameon=False)
    figure.align_ylabels(axes)
    return figure


def first_ones(marks: Iterable[Mark]) -> list[Mark]:
    kept: list[Mark] = []
    for mark in marks:
        if mark.kind is not MarkKind.ALERT or all(m.kind is not MarkKind.ALERT for m in kept):
            kept.append(mark)
    return kept


def _lines(axis: "Axes", pair: Pair, channel: str, shown: np.ndarray) -> None:
    """Draw the golden line dashed above the solid faulty line, so that both are visible if they coincide."""
    t = pair.t[shown]
    axis.plot(t, finite(pair.faulty[channel][shown]), "-", color=FAULTY_COLOUR, linewidth=1.6, label="faulty")
    axis.plot(
        t, finite(pair.golden[channel][shown]), "--", color=GOLDEN_COLOUR, linewidth=1.6, label="fault-free"
    )
    axis.grid(visible=True, linewidth=0.4, alpha=0.5)
    axis.margins(y=0.08)


def _shade(axis: "Axes", t: np.ndarray, steps: Steps) -> None:
    edges = np.flatnonzero(np.diff(np.concatenate(([0], steps.astype(int), [0]))))
    for begin, end in edges.reshape(-1, 2):
        axis.axvspan(t[begin], t[end - 1], color=SHADE, alpha=0.45, linewidth=0)


def _mark(axes: Sequence["Axes"], marks: Sequence[Mark], width: float) -> None:
    """Draw a line through all panels for each mark. Its name is above, on the lowest free level."""
    free: list[float] = []  # the end of the last name on each level
    end, room = axes[0].get_xlim()[1], LABEL_SHARE * width
    for mark in marks:
        for axis in axes:
            axis.axvline(
                mark.t,
                color=MARK_COLOURS[mark.kind],
                linestyle=MARK_LINES[mark.kind],
                linewidth=1.8 if mark.kind is MarkKind.HAZARD else 1.1,
            )
        fits = mark.t + room <= end  # else the name ends at its mark instead of beginning there
        begin = mark.t if fits else mark.t - room
        level = next((i for i, taken in enumerate(free) if taken <= begin), len(free))
        free[level : level + 1] = [begin + room]
        what = f"first alert, {mark.label}" if mark.kind is MarkKind.ALERT else mark.label
        axes[0].annotate(
            f"{what} {mark.t:.2f} s",
            (mark.t, 1.0),
            xycoords=("data", "axes fraction"),
            xytext=(0, 3 + 11 * level),
            textcoords="offset points",
            ha="left" if fits else "right",
            fontsize=style.SMALL,
            color=MARK_COLOURS[mark.kind],
        )
