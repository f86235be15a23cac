"""The panel of runs that did not finish normally, harness errors first."""

from collections.abc import Sequence

from mutator._common.table_rendering import TextTable
from mutator.model import Status
from mutator.report.panel import Panel, rendered
from mutator.report.reported_run import ReportedRun
from mutator.results.result_rows import ResultRow, rows_of

_FAILURES = [status.value for status in Status if status not in (Status.OK, Status.LEFT_OUT)]
_COLUMN_HEADS = ("status", "experiment", "fault", "scenario", "message")
MOST_RUNS_IN_MARKDOWN, MOST_RUNS_ON_PAGE = (
    30,
    200,
)  # maximum number of runs in Markdown and on the page, whose search finds all
_HTML_TEMPLATE = """\
<h2>Runs that did not finish normally</h2>
<p>A harness error says nothing about its fault, so no count includes it.</p>
{{ table.as_html() }}
{% if more > 0 %}
<p>And {{ more }} more: <a href="#status={{ failings | join(',') }}">all of them</a>.</p>
{% endif %}
"""


def build_failed_runs_panel(run: ReportedRun) -> Panel | None:
    """Return the panel of failed runs with their messages; None if no run failed."""
    results = run.results[run.results["status"].isin(_FAILURES)]
    if results.empty:
        return None
    from pandas import DataFrame

    sort_keys = {
        "other": results["status"] != Status.HARNESS_ERROR.value,
        **results[["status", "experiment_id"]],
    }
    order = (
        DataFrame(sort_keys).sort_values([*sort_keys]).index[: max(MOST_RUNS_IN_MARKDOWN, MOST_RUNS_ON_PAGE)]
    )
    failed = rows_of(results.loc[order], run.faults)
    return Panel(
        anchor="failed",
        link="Failed runs",
        markdown=f"## Runs that did not finish normally\n\n{_failed_runs_markdown(failed, len(results))}",
        html=rendered(
            _HTML_TEMPLATE,
            table=_linked_table(failed),
            more=len(results) - MOST_RUNS_ON_PAGE,
            failings=_FAILURES,
        ),
    )


def _failed_runs_markdown(failed: Sequence[ResultRow], count: int) -> str:
    rows = [
        (r.status.value, r.experiment_id, r.fault, r.scenario_label, r.detail)
        for r in failed[:MOST_RUNS_IN_MARKDOWN]
    ]
    table = TextTable(heads=_COLUMN_HEADS, rows=rows).as_markdown()
    more = count - MOST_RUNS_IN_MARKDOWN
    return f"{table}\n\nOthers in `results.csv`: {more}." if more > 0 else table


def _linked_table(failed: Sequence[ResultRow]) -> TextTable:
    from markupsafe import Markup

    ending = Markup('<span class="ending {0}">{0}</span>').format
    link = Markup('<a href="#e={0}"><code>{0}</code></a>').format
    rows = [
        (ending(r.status.value), link(r.experiment_id), r.fault, r.scenario_label, r.detail)
        for r in failed[:MOST_RUNS_ON_PAGE]
    ]
    return TextTable(heads=_COLUMN_HEADS, rows=rows)
