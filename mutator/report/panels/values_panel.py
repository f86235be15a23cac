"""The panel of value and margin: plots that the page's scripts draw, and how soon hazards come."""

from mutator._common.table_rendering import TextTable
from mutator.report.panel import Panel, rendered
from mutator.report.reported_run import ReportedRun
from mutator.statistics.event_time_statistics import share_of_hazards_within
from mutator.statistics.shares_with_intervals import Share
from mutator.statistics.sheet_selection import DEFAULT_DRIVER_REACTION_S

_INTRODUCTION = (
    "Each mark is an experiment: the value of its fault, in the unit of the spec, and how near it came "
    "to a hazard."
)
_HAZARD_WITHIN_TIMES_S = (0.5, 1.0, 2.0, 5.0, 10.0)  # reaction times of the table, besides the assumed one
_HTML_TEMPLATE = """\
<h2>Value and margin</h2>
<p class="no-print">{{ about }} Colour and shape show the scenario; the dashed line is the limit. Select a
mark to open its experiment. Search and filters do not change these plots.</p>
<div id="value-plots"></div>
<details>
<summary>How soon hazards come</summary>
{{ table.as_html("counts") }}
</details>
"""


def build_values_panel(run: ReportedRun) -> Panel | None:
    """Return the panel; None if no usable experiment has a number as its value."""
    if not run.frame["value"].notna().any():
        return None
    times = sorted({*_HAZARD_WITHIN_TIMES_S, DEFAULT_DRIVER_REACTION_S})
    table = TextTable(
        heads=("time from activation", "hazards that have come by then"),
        rows=[(f"{time:g} s", _share_text(share_of_hazards_within(run.frame, time))) for time in times],
    )
    markdown = (
        "## Value and margin",
        "The plots of value and margin are in `index.html`. How soon hazards come:",
        table.as_markdown(),
    )
    return Panel(
        anchor="values",
        link="Value and margin",
        markdown="\n\n".join(markdown),
        html=rendered(_HTML_TEMPLATE, about=_INTRODUCTION, table=table),
    )


def _share_text(share: Share) -> str:
    return str(share) if share.of else "no hazard"
