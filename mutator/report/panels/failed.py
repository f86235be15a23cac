"""Runs that did not end well, harness errors first."""

from collections.abc import Sequence

from mutator._common.tables import Table
from mutator.model import Status
from mutator.outcomes.rows import Row
from mutator.report.panel import Panel, rendered
from mutator.report.studies import ReportedRun

_HEADS = ("status", "experiment", "fault", "scenario", "what was said")
LISTED, PAGE_LISTED = 30, 200  # runs that the Markdown and the page list; the page can find all
_HTML = """\
<h2>Runs that did not end well</h2>
<p>A harness error says nothing about its fault and is in no count.</p>
{{ table.as_html() }}
{% if more > 0 %}
<p>{{ more }} more: <a href="#status={{ failings | join(',') }}">all of them</a>.</p>
{% endif %}
"""


def failed_panel(run: ReportedRun) -> Panel | None:
    """What each of them said; None where all ended well."""
    failed = [row for row in run.rows if row.status is not Status.OK]
    if not failed:
        return None
    failed.sort(key=lambda r: (r.status is not Status.HARNESS_ERROR, r.status, r.experiment_id))
    failings = [status.value for status in Status if status is not Status.OK]
    return Panel(
        anchor="failed",
        link="Failed runs",
        markdown=f"## Runs that did not end well\n\n{_markdown(failed)}",
        html=rendered(_HTML, table=_linked(failed), more=len(failed) - PAGE_LISTED, failings=failings),
    )


def _markdown(failed: Sequence[Row]) -> str:
    rows = [(r.status.value, r.experiment_id, r.fault, r.scenario, r.detail) for r in failed[:LISTED]]
    table = Table(heads=_HEADS, rows=rows).as_markdown()
    more = len(failed) - LISTED
    return f"{table}\n\n{more} more are in `results.csv`." if more > 0 else table


def _linked(failed: Sequence[Row]) -> Table:
    """The table of the page: each experiment a link that opens it."""
    from markupsafe import Markup

    ending = Markup('<span class="ending {0}">{0}</span>').format
    link = Markup('<a href="#e={0}"><code>{0}</code></a>').format
    rows = [
        (ending(r.status.value), link(r.experiment_id), r.fault, r.scenario, r.detail)
        for r in failed[:PAGE_LISTED]
    ]
    return Table(heads=_HEADS, rows=rows)
