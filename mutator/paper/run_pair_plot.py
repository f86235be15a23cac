"""Draws a golden run (dashed) and a faulty run (solid) on one time axis, with marked events."""

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from mutator.figures import figure_style
from mutator.figures.golden_and_faulty_plot import (
    FAULTY_COLOUR,
    GOLDEN_COLOUR,
    MARK_COLOURS,
    MARK_LINE_STYLES,
    EventKind,
    EventMark,
    infinities_as_gaps,
)
from mutator.paper.unsafe_action_detection import ActionFigure, RunPair, StepFlags
from mutator.targets.manifest import TargetManifest

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SHOWN_BEFORE_S, SHOWN_AFTER_S = 4.0, 1.0  # time that is shown before activation and after the hazard
SHADE_COLOUR = "#bbbbbb"
MIN_AXIS_RANGE = 0.1  # minimum range of a vertical axis; less would magnify noise
LABEL_WIDTH_SHARE = 0.12  # width of a mark's label as a share of the time axis


@figure_style.shipped_style()
def plot_run_pair(
    pair: RunPair,
    steps: StepFlags,
    figure_spec: ActionFigure,
    marks: Iterable[EventMark],
    manifest: TargetManifest,
) -> "Figure":
    """Draw the panels of `figure_spec` that both runs have. In its action channels, shade `steps`."""
    units = {
        channel.name: channel.unit
        for channel in (*manifest.compared_channels, *manifest.non_actuator_channels)
    }
    panels = [(c, meaning) for c, meaning in figure_spec.panels if c in pair.golden and c in pair.faulty]
    first_s = max(float(pair.times_s[0]), pair.start_s - SHOWN_BEFORE_S)
    last_s = min(float(pair.times_s[-1]), pair.end_s + SHOWN_AFTER_S)
    # inches: legend and time axis, then each panel
    figure, axes = figure_style.blank_figure(1.1 + 1.35 * len(panels), len(panels), 1)
    is_visible = (pair.times_s >= first_s) & (pair.times_s <= last_s)
    for axis, (channel, what) in zip(axes, panels, strict=True):
        _plot_channel(axis, pair, channel, is_visible)
        axis.set_ylabel(f"{what} [{units.get(channel) or '-'}]", fontsize=figure_style.TEXT_POINTS)
        axis.set_xlim(first_s, last_s)
        if channel in figure_spec.action_channels:
            _shade_steps(axis, pair.times_s, steps)
        low, high = axis.get_ylim()
        axis.set_ylim(low, max(high, low + MIN_AXIS_RANGE))
        axis.tick_params(labelbottom=axis is axes[-1])
    axes[-1].set_xlabel("time [s]", fontsize=figure_style.TEXT_POINTS)
    _draw_marks(
        axes,
        [mark for mark in with_first_alert_only(marks) if first_s <= mark.t_s <= last_s],
        last_s - first_s,
    )
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(
        handles,
        labels,
        loc="outside lower left",
        ncols=2,
        fontsize=figure_style.SMALL_TEXT_POINTS,
        frameon=False,
    )
    figure.align_ylabels(axes)
    return figure


def with_first_alert_only(marks: Iterable[EventMark]) -> list[EventMark]:
    shown_marks: list[EventMark] = []
    for mark in marks:
        if mark.kind is not EventKind.ALERT or all(m.kind is not EventKind.ALERT for m in shown_marks):
            shown_marks.append(mark)
    return shown_marks


def _plot_channel(axis: "Axes", pair: RunPair, channel: str, is_visible: np.ndarray) -> None:
    """Draw the golden line dashed above the solid faulty line, so that both are visible if they coincide."""
    t = pair.times_s[is_visible]
    axis.plot(
        t,
        infinities_as_gaps(pair.faulty[channel][is_visible]),
        "-",
        color=FAULTY_COLOUR,
        linewidth=1.6,
        label="faulty",
    )
    axis.plot(
        t,
        infinities_as_gaps(pair.golden[channel][is_visible]),
        "--",
        color=GOLDEN_COLOUR,
        linewidth=1.6,
        label="fault-free",
    )
    axis.grid(visible=True, linewidth=0.4, alpha=0.5)
    axis.margins(y=0.08)


def _shade_steps(axis: "Axes", times_s: np.ndarray, steps: StepFlags) -> None:
    # zeros at both ends let the first and the last step begin and end a shade
    edges = np.flatnonzero(np.diff(np.concatenate(([0], steps.astype(int), [0]))))
    for begin, end in edges.reshape(-1, 2):
        axis.axvspan(times_s[begin], times_s[end - 1], color=SHADE_COLOUR, alpha=0.45, linewidth=0)


def _draw_marks(axes: Sequence["Axes"], marks: Sequence[EventMark], time_span_s: float) -> None:
    """Draw a line through all panels for each mark. Its name is above, on the lowest free level."""
    level_ends: list[float] = []  # the end of the last name on each level
    end, label_width = axes[0].get_xlim()[1], LABEL_WIDTH_SHARE * time_span_s
    for mark in marks:
        for axis in axes:
            axis.axvline(
                mark.t_s,
                color=MARK_COLOURS[mark.kind],
                linestyle=MARK_LINE_STYLES[mark.kind],
                linewidth=1.8 if mark.kind is EventKind.HAZARD else 1.1,
            )
        fits = mark.t_s + label_width <= end  # else the name ends at its mark instead of beginning there
        begin = mark.t_s if fits else mark.t_s - label_width
        level = next((i for i, name_end in enumerate(level_ends) if name_end <= begin), len(level_ends))
        level_ends[level : level + 1] = [begin + label_width]
        label = f"first alert, {mark.label}" if mark.kind is EventKind.ALERT else mark.label
        axes[0].annotate(
            f"{label} {mark.t_s:.2f} s",
            (mark.t_s, 1.0),
            xycoords=("data", "axes fraction"),
            xytext=(0, 3 + 11 * level),  # points; a line of text is 11 high
            textcoords="offset points",
            ha="left" if fits else "right",
            fontsize=figure_style.SMALL_TEXT_POINTS,
            color=MARK_COLOURS[mark.kind],
        )
