"""The figure of an envelope: cells over duration and magnitude."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

from mutator.explore.cell_results import CellState
from mutator.explore.envelope import Envelope
from mutator.explore.lattice import cell_edges
from mutator.explore.plane_search import cells_with
from mutator.figures import figure_style

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_WITHOUT_COLOUR, _HAZARD_COLOUR, _UNDECIDED_COLOUR = "#009e73", "#d55e00", "#888888"
_DISENGAGED_COLOUR = "#000000"
_SHADES = (
    ((CellState.WITHOUT_HAZARD, CellState.BETWEEN_WITHOUT), _WITHOUT_COLOUR, 0.2, "without hazard"),
    ((CellState.INFERRED,), _HAZARD_COLOUR, 0.45, "hazard inferred"),
    ((CellState.HAZARDOUS, CellState.BETWEEN_HAZARDOUS), _HAZARD_COLOUR, 0.2, "hazardous"),
    (
        (CellState.DISENGAGED, CellState.NOT_DECIDED, CellState.UNKNOWN),
        _UNDECIDED_COLOUR,
        0.25,
        "not decided",
    ),
)
_MARKS = (
    (CellState.WITHOUT_HAZARD, _WITHOUT_COLOUR, "o", "run without hazard"),
    (CellState.HAZARDOUS, _HAZARD_COLOUR, "s", "run with hazard"),
    (CellState.DISENGAGED, _DISENGAGED_COLOUR, "x", "run that ended disengaged"),
    (CellState.NOT_DECIDED, _UNDECIDED_COLOUR, ".", "run that decides nothing"),
)


@figure_style.shipped_style()
def draw_envelope(envelope: Envelope) -> "Figure":
    """Draw an envelope: cells shaded, and runs as marks."""
    plane = envelope.plane
    figure, [axis] = figure_style.blank_figure(4.5, 1, 1)
    heights = [1.0 if value is None else abs(value) for value in envelope.magnitudes]
    handles = [*_draw_shades(axis, envelope, heights), *_draw_marks(axis, envelope, heights)]
    axis.set_xscale("log")
    axis.set_xlabel("duration [s]", fontsize=figure_style.TEXT_POINTS)
    if plane.magnitudes:
        axis.set_yscale("log")
        sign = "minus the " if plane.magnitudes[0] < 0 else ""
        unit = f" [{plane.unit}]" if plane.unit else ""
        axis.set_ylabel(f"{sign}magnitude{unit}", fontsize=figure_style.TEXT_POINTS)
    else:
        axis.set_yticks([])
    title = f"{plane.spec} in {plane.scenario} from {envelope.drive.start_s:g} s"
    axis.set_title(title, fontsize=figure_style.TEXT_POINTS, loc="left")
    figure.legend(
        handles=handles,
        loc="outside lower center",
        ncols=4,
        fontsize=figure_style.SMALL_TEXT_POINTS,
        frameon=False,
    )
    return figure


def _draw_shades(axis: "Axes", envelope: Envelope, heights: list[float]) -> "Iterator[Artist]":
    from matplotlib.collections import PatchCollection
    from matplotlib.patches import Patch, Rectangle

    xs, ys = cell_edges(envelope.durations_s), cell_edges(heights)
    axis.set_xlim(xs[0], xs[-1])
    axis.set_ylim(ys[0], ys[-1])
    for states, colour, opacity, label in _SHADES:
        rectangles = [
            Rectangle((xs[j], ys[i]), xs[j + 1] - xs[j], ys[i + 1] - ys[i])
            for i, j in cells_with(states, envelope.cells)
        ]
        if rectangles:
            axis.add_collection(PatchCollection(rectangles, facecolor=colour, alpha=opacity, linewidth=0))
            yield Patch(facecolor=colour, alpha=opacity, label=label)


def _draw_marks(axis: "Axes", envelope: Envelope, heights: list[float]) -> "Iterator[Artist]":
    for state, colour, marker, label in _MARKS:
        cells = list(cells_with((state,), envelope.cells))
        if cells:
            xs, ys = [envelope.durations_s[j] for _, j in cells], [heights[i] for i, _ in cells]
            yield from axis.plot(
                xs, ys, marker, color=colour, markersize=4, linestyle="", clip_on=False, label=label
            )
