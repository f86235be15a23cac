"""The panel that shows how much results vary between seeds.

Runs with one seed have no such panel, and benches neither: their seeds have different experiments.
"""

from mutator._common.table_rendering import TextTable
from mutator.report.panel import Panel, rendered
from mutator.report.panels.tables_panel import sheet_csv_and_markdown_files
from mutator.report.reported_run import ReportedRun
from mutator.statistics.seed_spread_tables import ALL_FAULTS, seeds_by_fault_type_sheet, seeds_of, seeds_sheet
from mutator.statistics.statistics_sheet import Sheet, cell_text

_HTML_TEMPLATE = """\
<h2>Seeds</h2>
<p>{{ about }}</p>
{% for sheet in sheets %}
<details class="table"{{ " open" if loop.first }}>
<summary><h3>{{ sheet.title }}</h3></summary>
<p>{{ sheet.note | marked }}</p>
{{ sheet.table().as_html() }}
</details>
{% endfor %}
"""


def build_seeds_panel(run: ReportedRun) -> Panel | None:
    """Return the panel with the spread of each share between seeds."""
    seeds = seeds_of(run.frame)
    if len(seeds) < 2 or run.folder.is_bench:
        return None
    sheets = (seeds_sheet(run.frame, has_alerts=run.folder.has_alerts), seeds_by_fault_type_sheet(run.frame))
    about = f"{len(seeds)} seeds ({seeds[0]} to {seeds[-1]}). Each seed repeats the campaign with new draws."
    markdown = "\n\n".join(["## Seeds", about, *(f"#{sheet.as_markdown().rstrip()}" for sheet in sheets)])
    html = rendered(_HTML_TEMPLATE, about=about, sheets=sheets)
    return Panel(
        anchor="seeds",
        link="Seeds",
        markdown=markdown,
        html=html,
        summary=_summary_table(sheets[0]),
        files=sheet_csv_and_markdown_files(sheets),
    )


def _summary_table(sheet: Sheet) -> TextTable:
    """Return the lines over all faults, with fewer columns."""
    rows = []
    for faults, part, whole, share, *cells, _ in sheet.lines:
        if faults == ALL_FAULTS:
            low, high, least, its, largest, other = map(cell_text, cells)
            ends = [f"{least} (seed {its})", f"{largest} (seed {other})"] if its != "-" else ["-", "-"]
            rows.append([f"{part} / {whole}", cell_text(share), f"{low} to {high}", *ends])
    heads = ("share", "all seeds, 95 % of runs", "95 % between seeds", "least", "largest")
    return TextTable(heads=heads, rows=rows)
