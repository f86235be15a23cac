"""Draw the golden and the faulty run on one time axis, with marks for events.

It uses matplotlib without pyplot, so it needs no display and is deterministic.
"""

import io
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mutator._common.files import write_atomic
from mutator.errors import MutatorError
from mutator.figures.figure_style import PNG_DPI, figure_type, shipped_style
from mutator.model import Record
from mutator.outcomes.trace_and_record_loading import Trace, times_of
from mutator.targets.channels import Channel
from mutator.targets.manifest import TargetManifest

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

GOLDEN_COLOUR = "#0072b2"  # blue and vermilion are distinct in greyscale and to colour-blind people
FAULTY_COLOUR = "#d55e00"
AFTER_END_COLOUR = "#999999"  # for data after the end of the drive
PANEL_HEIGHT_INCHES = 1.1  # inches
FIGURE_WIDTH_INCHES = 9.0


class EventKind(StrEnum):
    """The event at a marked time."""

    TRIGGER = "trigger"
    MANIFEST = "manifest"
    ALERT = "alert"
    HAZARD = "hazard"


MARK_COLOURS = {
    EventKind.TRIGGER: "#555555",
    EventKind.MANIFEST: "#009e73",
    EventKind.ALERT: "#b8860b",
    EventKind.HAZARD: "#b00020",
}
MARK_LINE_STYLES = {
    EventKind.TRIGGER: "-",
    EventKind.MANIFEST: ":",
    EventKind.ALERT: "--",
    EventKind.HAZARD: "-",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class EventMark:
    kind: EventKind
    t_s: float
    label: str


def event_marks(record: Record) -> tuple[EventMark, ...]:
    marks = []
    if record.activation is not None:
        marks.append(EventMark(kind=EventKind.TRIGGER, t_s=record.activation.first, label="activated"))
    if record.t_manifest is not None:
        marks.append(EventMark(kind=EventKind.MANIFEST, t_s=record.t_manifest, label="manifested"))
    marks += [EventMark(kind=EventKind.ALERT, t_s=t, label=name) for name, t in record.alerts]
    marks += [EventMark(kind=EventKind.HAZARD, t_s=t, label=name) for name, t in record.hazards]
    return tuple(sorted(marks, key=lambda m: m.t_s))


@shipped_style()
def draw_golden_and_faulty(
    golden: Trace,
    faulty: Trace,
    manifest: TargetManifest,
    *,
    title: str,
    marks: Iterable[EventMark] = (),
    end: float | None = None,
) -> "Figure":
    """Draw the manifest's channels of two runs, one panel each, compared channels (actuators) first.

    Data after the `end` of the drive (s) is grey and does not affect the axes. MutatorError if no channel is
    in both runs.
    """
    channels = [
        c
        for c in (*manifest.compared_channels, *manifest.non_actuator_channels)
        if c.name in golden and c.name in faulty
    ]
    if not channels:
        raise MutatorError("no channel of the manifest is in both traces", where=manifest.path)
    figure, axes = _new_figure(len(channels))
    time = manifest.time_channel
    for axis, channel in zip(axes, channels, strict=True):
        lines = [(times_of(trace, channel.name, time), trace[channel.name]) for trace in (golden, faulty)]
        _draw_channel(axis, channel, lines[0], lines[1], np.inf if end is None else end)
    _draw_marks(figure, axes, title, tuple(marks), end)
    return figure


def _new_figure(rows: int) -> tuple["Figure", list["Axes"]]:
    figure = figure_type()(
        figsize=(FIGURE_WIDTH_INCHES, 1.1 + PANEL_HEIGHT_INCHES * rows), layout="constrained"
    )
    axes = figure.subplots(rows, 1, sharex=True, squeeze=False)[:, 0]
    return figure, list(axes)


def _draw_channel(
    axis: "Axes", channel: Channel, golden: tuple[Any, Any], faulty: tuple[Any, Any], end: float
) -> None:
    """Draw one channel: a wide golden line below a narrow faulty line, so that both show if equal."""
    looks = ((golden, GOLDEN_COLOUR, 2.4, 0.55, "golden"), (faulty, FAULTY_COLOUR, 1.1, 1.0, "faulty"))
    axis.margins(x=0.01, y=0.12)
    for (time, values), colour, width, alpha, label in looks:
        driven = np.where(time <= end, infinities_as_gaps(values), np.nan)
        axis.plot(time, driven, color=colour, linewidth=width, alpha=alpha, label=label)
    axis.set_ylim(axis.get_ylim())  # only the drive sets the limits
    for (time, values), _, width, alpha, _ in looks:
        if (time > end).any():
            later = np.where(time >= end, infinities_as_gaps(values), np.nan)
            axis.plot(time, later, color=AFTER_END_COLOUR, linewidth=width, alpha=alpha)
    unit = f"\n[{channel.unit}]" if channel.unit not in ("", "-") else ""
    axis.set_ylabel(channel.name + unit, fontsize=8)
    axis.tick_params(labelsize=8)
    axis.grid(visible=True, linewidth=0.4, alpha=0.5)


def _draw_marks(
    figure: "Figure", axes: list["Axes"], title: str, marks: tuple[EventMark, ...], end: float | None
) -> None:
    colours = [AFTER_END_COLOUR if end is not None and m.t_s > end else MARK_COLOURS[m.kind] for m in marks]
    left, right = axes[0].get_xlim()
    for axis in axes:
        for mark, colour in zip(marks, colours, strict=True):
            axis.axvline(mark.t_s, color=colour, linestyle=MARK_LINE_STYLES[mark.kind], linewidth=1.0)
        if end is not None:
            axis.axvspan(end, right, color=AFTER_END_COLOUR, alpha=0.15, linewidth=0)
    axes[0].set_xlim(left, right)
    top = axes[0]
    # Labels rotate through three heights, so that those of close marks do not overlap.
    for i, (mark, colour) in enumerate(zip(marks, colours, strict=True)):
        top.annotate(
            f"{mark.label} {mark.t_s:.2f}",
            (mark.t_s, 1.0),
            xycoords=("data", "axes fraction"),
            xytext=(2, 2 + 9 * (i % 3)),
            textcoords="offset points",
            fontsize=7,
            color=colour,
        )
    axes[-1].set_xlabel("time [s]", fontsize=8)
    top.legend(loc="best", fontsize=7, ncols=2, frameon=False)
    figure.suptitle(title, fontsize=10, x=0.01, ha="left")


def save_figure(figure: "Figure", paths: Sequence[Path]) -> None:
    """Write a figure to each of `paths` as .svg or .png, by suffix, deterministically."""
    for path, image in zip(paths, render_images(figure, [path.suffix[1:] for path in paths]), strict=True):
        path.parent.mkdir(parents=True, exist_ok=True)
        write_atomic(path, image)


@shipped_style()
def render_images(figure: "Figure", formats: Sequence[str]) -> list[bytes]:
    """Draw a figure in each format, `svg` or `png`, deterministically."""
    if figure.get_layout_engine() is not None:  # once for all files, because layout takes as long as drawing
        figure.draw_without_rendering()
        figure.set_layout_engine("none")
    drawn = []
    for name in formats:
        no_date = {"Date": None} if name == "svg" else None  # keeps the SVG deterministic
        figure.savefig(file := io.BytesIO(), format=name, dpi=PNG_DPI, metadata=no_date)
        drawn.append(file.getvalue())
    return drawn


def infinities_as_gaps(values: Any) -> Any:
    """Replace infinities, such as the headway time at standstill, with gaps."""
    array = np.asarray(values, dtype=float)
    return np.where(np.isfinite(array), array, np.nan)
