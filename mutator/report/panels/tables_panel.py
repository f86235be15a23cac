"""The panels of counts and statistics. The statistics are also files."""

from collections.abc import Collection, Sequence
from dataclasses import replace
from operator import itemgetter

from mutator._common.table_rendering import TextTable
from mutator.outcomes.fault_free_runs import fault_free_alerts_note, fault_free_table, unlisted_runs_note
from mutator.report.panel import Panel, rendered
from mutator.report.reported_run import ReportedRun
from mutator.results.outcome_counting import (
    checked_hazard_names,
    count_outcomes_by_group,
    count_table,
    families_or_scenarios_of,
    fault_types_of,
)
from mutator.statistics.fault_free_drive_tables import (
    JudgedDrive,
    drives_by_group_sheet,
    each_drive_sheet,
    load_judged_drives,
)
from mutator.statistics.metric_and_severity_tables import (
    metrics_sheet,
    severity_by_fault_type_sheet,
    times_to_hazard_sheet,
)
from mutator.statistics.published_counts import PublishedCounts
from mutator.statistics.sheet_selection import run_sheets
from mutator.statistics.statistics_sheet import Sheet
from mutator.store.run_folder import RunFolder

TABLES_FOLDER = "tables"  # a folder of the report
COUNTS_NOTE = (
    "*Injected*: experiments with a valid result. Harness errors and invalid mutants are counted "
    "separately. *Activated*: an injected statement ran while the trigger held. "
    "*Manifested*: an actuator output then differed from the fault-free run."
)
NO_ALERT_NOTE = " *Hazard, no alert*: no alert at all, before or after the hazard."
FAULT_FREE_NOTE = "The golden runs: first times of alerts and hazards, and the range of each plotted channel."
_GROUPINGS = (
    ("By fault type", "fault type", fault_types_of),
    ("By scenario", "scenario", families_or_scenarios_of),
    ("By method", "method", itemgetter("method")),
)
_HTML_TEMPLATE = """\
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


def counts_note(folder: RunFolder) -> str:
    note = f" {folder.early_end_note}" if folder.early_end_note else ""
    return COUNTS_NOTE + (NO_ALERT_NOTE + note if folder.has_alerts else "")


def build_tables_panel(run: ReportedRun) -> Panel:
    """Return the panel of counts, then statistics. Tables with published counterparts are on the study's
    page.
    """
    runs = run.fault_free_runs()
    golden_alerts_note = fault_free_alerts_note(runs)
    statistic_sheets = () if run.has_study_page else _statistic_sheets(run, None)
    counts, sheets = (
        _count_tables(run),
        [
            _with_alerts_note(sheet, golden_alerts_note)
            for sheet in (*statistic_sheets, *_distribution_sheets(run))
        ],
    )
    parts = [counts_note(run.folder)]
    for title, table in counts:
        parts += filter(None, (f"## {title}", golden_alerts_note, table.as_markdown()))
    fault_free = fault_free_table(runs, alerts=run.folder.has_alerts) if runs else None
    fault_free_note = " ".join(filter(None, (FAULT_FREE_NOTE, unlisted_runs_note(runs))))
    if fault_free:
        parts += ["## Fault-free runs", fault_free_note, fault_free.as_markdown()]
    drives = load_judged_drives(run.folder)
    if drives:
        sheets.insert(0, _drives_sheet(run.folder, drives))
    parts += [sheet.as_markdown().rstrip() for sheet in sheets]
    files = sheet_csv_and_markdown_files(sheets)
    if drives:
        files |= sheet_csv_files([each_drive_sheet(drives, run.folder.head.hazards)])
    html = rendered(
        _HTML_TEMPLATE,
        title="Tables",
        counts=counts,
        note=golden_alerts_note,
        fault_free=fault_free,
        about=fault_free_note,
        sheets=sheets,
    )
    return Panel(
        anchor="tables",
        link="Tables",
        markdown="\n\n".join(parts),
        html=html,
        files=files,
    )


def _drives_sheet(folder: RunFolder, drives: Sequence[JudgedDrive]) -> Sheet:
    measured = {name for drive in drives for name, _ in drive.verdict.metrics}
    lower_is_worse = {
        metric.name: metric.worse
        for metric in folder.head.metrics
        if metric.worse == "lower" and metric.name in measured
    }
    return drives_by_group_sheet(drives, folder.head.hazards, lower_is_worse)


def build_published_comparison_panel(run: ReportedRun) -> Panel | None:
    """Return the panel of the run's statistics next to the published ones of its study; None if there are
    none.
    """
    golden_alerts_note = fault_free_alerts_note(run.fault_free_runs())
    published = run.published_work.published(run) if run.published_work else None
    sheets = [_with_alerts_note(sheet, golden_alerts_note) for sheet in _statistic_sheets(run, published)]
    if not sheets:
        return None
    title = "Tables next to the published ones"
    markdown = "\n\n".join([f"## {title}", *(f"#{sheet.as_markdown().rstrip()}" for sheet in sheets)])
    html = rendered(_HTML_TEMPLATE, title=title, counts=(), fault_free=None, sheets=sheets)
    return Panel(
        anchor="tables",
        link="Tables",
        markdown=markdown,
        html=html,
        files=sheet_csv_and_markdown_files(sheets),
    )


def _count_tables(run: ReportedRun) -> list[tuple[str, TextTable]]:
    hazards = checked_hazard_names(run.results)
    tables = []
    for title, head, groups in _GROUPINGS:
        if head == "method" and run.results["method"].nunique() == 1:
            continue  # as many columns of numbers as the table above, and no comparison
        counts = count_outcomes_by_group(run.results, groups(run.results))
        heads, lines = count_table(counts, head, hazards, alerts=run.folder.has_alerts)
        tables.append((title, TextTable(heads=heads, rows=lines, right_aligned=range(1, len(heads)))))
    return tables


def _statistic_sheets(run: ReportedRun, published: PublishedCounts | None) -> tuple[Sheet, ...]:
    alerts = run.experiment_facts.alerts_by_hazardous_id if run.folder.has_alerts else None
    return run_sheets(run.frame, published, alerts, run.latest_golden_end_by_scenario())


def _distribution_sheets(run: ReportedRun) -> tuple[Sheet, ...]:
    sheets = (
        severity_by_fault_type_sheet(run.frame, run.folder.severity_scale),
        times_to_hazard_sheet(
            run.frame,
            run.frame["experiment_id"].isin(run.experiment_facts.ids_active_at_hazard),
            has_alerts=run.folder.has_alerts,
        ),
        metrics_sheet(run.frame, run.folder.head.metrics),
    )
    return tuple(sheet for sheet in sheets if sheet.lines)


def _with_alerts_note(sheet: Sheet, note: str) -> Sheet:
    words = (sheet.title, *sheet.heads, *(line[0] for line in sheet.lines))
    if not note or not any("alert" in str(word).lower() for word in words):
        return sheet
    return replace(sheet, note=f"{sheet.note} {note}")


def sheet_csv_and_markdown_files(sheets: Collection[Sheet]) -> dict[str, bytes]:
    """Each table as tables/<name>.csv and <name>.md."""
    texts = {f"{TABLES_FOLDER}/{sheet.name}.md": sheet.as_markdown().encode() for sheet in sheets}
    return texts | sheet_csv_files(sheets)


def sheet_csv_files(sheets: Collection[Sheet]) -> dict[str, bytes]:
    return {f"{TABLES_FOLDER}/{sheet.name}.csv": sheet.as_csv().encode() for sheet in sheets}
