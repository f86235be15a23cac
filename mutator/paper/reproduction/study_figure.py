"""The figure of the study: hazards of activated guided faults by fault type, in the paper and here."""

import math

from mutator.figures.figure_style import TEXT_POINTS, blank_figure, shipped_style
from mutator.figures.golden_and_faulty_plot import render_images
from mutator.paper.fault_type_rank_agreement import GUIDED
from mutator.paper.reproduction.page_rendering import PAPER, StudyPages
from mutator.paper.reproduction.study_tables import tally_of_row
from mutator.statistics.shares_with_intervals import share_with_interval
from mutator.statistics.tallies import Tally

_HEIGHT_INCHES = 7.0
_SPREAD = 0.7  # of the marks of one fault type, in rows
_COLOURS = ("#222222", "#0072b2", "#d55e00", "#e69f00", "#009e73", "#56b4e9")
_MARKERS = ("D", "o", "s", "s", "^", "^")


@shipped_style()
def draw_hazard_shares(study: StudyPages) -> bytes:
    """Return the figure as SVG, drawn from the tables alone."""
    kinds = [kind for how, kind in study.published.tally_by_fault_type if how == GUIDED]
    sources: list[tuple[str, dict[str, Tally]]] = [
        (PAPER, {kind: study.published.tally_by_fault_type[GUIDED, kind] for kind in kinds})
    ]
    for campaign in study.whole:
        rows = study.tables.rows("fault_types", campaign=campaign.name, method=GUIDED)
        sources.append((campaign.title, {row["fault_type"]: tally_of_row(row) for row in rows}))
    figure, [axis] = blank_figure(_HEIGHT_INCHES, 1, 1)
    for rank, (title, tallies) in enumerate(sources):
        offset = _SPREAD * ((rank + 0.5) / len(sources) - 0.5)
        for row, kind in enumerate(kinds):
            share = share_with_interval(*_counts(tallies.get(kind)))
            if math.isnan(share.rate):
                continue
            y, colour = row + offset, _COLOURS[rank % len(_COLOURS)]
            axis.plot([100 * share.low, 100 * share.high], [y, y], color=colour, linewidth=1)
            label = title if row == 0 else None
            marker = _MARKERS[rank % len(_MARKERS)]
            axis.plot([100 * share.rate], [y], marker, color=colour, markersize=3, label=label)
    axis.set_yticks(range(len(kinds)), kinds)
    axis.set_ylim(len(kinds) - 0.5, -0.5)
    axis.set_xlabel("hazards of activated guided faults, %, with 95 % intervals", fontsize=TEXT_POINTS)
    axis.legend(fontsize=TEXT_POINTS, frameon=False, loc="lower right")
    [svg] = render_images(figure, ("svg",))
    return svg


def _counts(tally: Tally | None) -> tuple[int, int]:
    return (tally.hazards, tally.activated) if tally else (0, 0)
