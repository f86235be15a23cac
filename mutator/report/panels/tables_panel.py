"""The panels of counts and statistics. The statistics are also files."""

from collections.abc import Collection
from dataclasses import replace
from operator import itemgetter

from mutator._common.table_rendering import TextTable
from mutator.outcomes.fault_free_runs import fault_free_alerts_note, fault_free_table
from mutator.report.panel import Panel, rendered
from mutator.report.reported_run import ReportedRun
from mutator.results.outcome_counting import count_outcomes, count_table, fault_types_of, hazard_names
from mutator.statistics.metric_tables import fault_tolerant_times_sheet, metrics_sheet, severity_sheet
from mutator.statistics.published_counts import PublishedCounts
from mutator.statistics.sheet_selection import run_sheets
from mutator.statistics.statistics_sheet import Sheet
from mutator.store.run_folder import RunFolder

FOLDER = "tables"  # a folder of the report
NOTES = (
    "*Injected*: experiments with a valid result. Harness errors and invalid mutants are counted "
    "separately. *Activated*: an injected statement ran while the trigger held. "
    "*Manifested*: an actuator output then differed from the fault-free run."
)
NO_ALERT = " *Hazard, no alert*: no alert at all, before or after the hazard."
FAULT_FREE = "The golden runs: first times of alerts and hazards, and the range of each plotted channel."
_GROUPS = (
    ("By fault type", "fault type", fault_types_of),
    ("By scenario", "scenario", itemgetter("scenario")),
    ("By method", "method", itemgetter("method")),
)
_HTML = """\
<h2>{{ title }}</h2>
{% for title, table in counts %}
<details class="table"{{ " open" if loop.first }}>
<summary><h3>{{ title }}</h3></summary>
{% if note %}
<p>{{ note }}</p>
{% endif %}
{{ table.as_html("counts") }}
</details>
{% endfor %}
{% if fault_free %}
<details class="table">
<summary><h3>Fault-free runs</h3></summary>
<p>{{ about }}</p>
{{ fault_free.as_html() }}
</details>
{% endif %}
{% for sheet in sheets %}
<details class="table">
<summary><h3>{{ sheet.title }}</h3></summary>
<p>{{ sheet.note | marked }}</p>
{{ sheet.table().as_html() }}
</details>
{% endfor %}
"""


def notes(folder: RunFolder) -> str:
    note = f" {folder.stop_note}" if folder.stop_note else ""
    return NOTES + (NO_ALERT + note if folder.has_alerts else "")


def build_tables_panel(run: ReportedRun) -> Panel:
    """Return the panel of counts, then statistics. Tables with published counterparts are on the study's
    page.
    """
    runs = run.fault_free()
    note = fault_free_alerts_note(runs)
    own = () if run.compared else _statistics(run, None)
    counts, sheets = _counts(run), [_noted(sheet, note) for sheet in (*own, *_spreads(run))]
    parts = [notes(run.folder)]
    for title, table in counts:
        parts += filter(None, (f"## {title}", note, table.as_markdown()))
    fault_free = fault_free_table(runs, alerts=run.folder.has_alerts) if runs else None
    if fault_free:
        parts += ["## Fault-free runs", FAULT_FREE, fault_free.as_markdown()]
    parts += [sheet.as_markdown().rstrip() for sheet in sheets]
    html = rendered(
        _HTML,
        title="Tables",
        counts=counts,
        note=note,
        fault_free=fault_free,
        about=FAULT_FREE,
        sheets=sheets,
    )
    return Panel(
        anchor="tables",
        link="Tables",
        markdown="\n\n".join(parts),
        html=html,
        files=sheet_files(sheets),
    )


def build_published_panel(run: ReportedRun) -> Panel | None:
    """Return the panel of the run's statistics next to the published ones of its study; None if there are
    none.
    """
    note = fault_free_alerts_note(run.fault_free())
    published = run.study.published(run) if run.study else None
    sheets = [_noted(sheet, note) for sheet in _statistics(run, published)]
    if not sheets:
        return None
    title = "Tables next to the published ones"
    markdown = "\n\n".join([f"## {title}", *(f"#{sheet.as_markdown().rstrip()}" for sheet in sheets)])
    html = rendered(_HTML, title=title, counts=(), fault_free=None, sheets=sheets)
    return Panel(anchor="tables", link="Tables", markdown=markdown, html=html, files=sheet_files(sheets))


def _counts(run: ReportedRun) -> list[tuple[str, TextTable]]:
    hazards = hazard_names(run.results)
    made = []
    for title, head, groups in _GROUPS:
        counts = count_outcomes(run.results, groups(run.results))
        heads, lines = count_table(counts, head, hazards, alerts=run.folder.has_alerts)
        made.append((title, TextTable(heads=heads, rows=lines, right_aligned=range(1, len(heads)))))
    return made


def _statistics(run: ReportedRun, published: PublishedCounts | None) -> tuple[Sheet, ...]:
    alerts = run.seen.alerts if run.folder.has_alerts else None
    return run_sheets(run.frame, published, alerts, run.ends())


def _spreads(run: ReportedRun) -> tuple[Sheet, ...]:
    made = (
        severity_sheet(run.frame),
        fault_tolerant_times_sheet(run.frame, alerts=run.folder.has_alerts),
        metrics_sheet(run.frame, run.folder.head.metrics),
    )
    return tuple(sheet for sheet in made if sheet.lines)


def _noted(sheet: Sheet, note: str) -> Sheet:
    words = (sheet.title, *sheet.heads, *(line[0] for line in sheet.lines))
    if not note or not any("alert" in str(word).lower() for word in words):
        return sheet
    return replace(sheet, note=f"{sheet.note} {note}")


def sheet_files(sheets: Collection[Sheet]) -> dict[str, bytes]:
    """Each table as tables/<name>.csv and <name>.md."""
    texts = {f"{FOLDER}/{sheet.name}.md": sheet.as_markdown().encode() for sheet in sheets}
    return texts | csv_files(sheets)


def csv_files(sheets: Collection[Sheet]) -> dict[str, bytes]:
    return {f"{FOLDER}/{sheet.name}.csv": sheet.as_csv().encode() for sheet in sheets}
