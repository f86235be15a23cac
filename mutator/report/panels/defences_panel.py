"""The panel of defences: what would have saved the worst, what it costs, and what it caused."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import groupby, islice
from operator import itemgetter
from urllib.parse import quote

from mutator._common.table_rendering import TextTable
from mutator.comparison.comparison_files import pairs_csv, render_html_page, unmatched_csv
from mutator.comparison.comparison_replays import ReportAddresses
from mutator.comparison.defended_pairs import PairOutcome
from mutator.comparison.defended_sets import DefendedSet
from mutator.comparison.defended_sheets import defence_sheets
from mutator.report.defence_sentences import describe_sets, hazardous_pairs
from mutator.report.panel import REPORT_FOLDER, Panel, rendered
from mutator.report.panels.tables_panel import sheet_csv_and_markdown_files
from mutator.report.reported_run import ReportedRun, manifest_if_any
from mutator.report.reported_sets import ReportedSet
from mutator.statistics.statistics_sheet import Sheet
from mutator.store.allowed_contents import DEFENDED_FOLDER

_SHEETS_SHOWN = (
    "defences",
    "defence_rates",
    "defended_hazards",
    "defended_severity",
    "defended_contacts",
    "defence_authority",
    "defences_without_faults",
    "unneeded_activations",
)
_MOST_LINES_OF_SET = 20  # shown of a table with a line for each experiment; the CSV has all
_HTML_TEMPLATE = """\
<h2>Defences</h2>
{% for sentence in sentences %}
<p>{{ sentence | marked }}</p>
{% endfor %}
<ul>
{% for of_set in reported %}
{% set name = of_set.defended.name %}
<li><a href="{{ of_set.page_name | urlencode }}">{{ name }}</a>: each drive beside the undefended one</li>
{% endfor %}
</ul>
{% for sheet in sheets %}
<details class="table"{{ " open" if loop.first }}>
<summary><h3>{{ sheet.title }}</h3></summary>
<p>{{ sheet.note | marked }}</p>
{{ sheet.table().as_html("plain") }}
</details>
{% endfor %}
"""


def build_defences_panel(run: ReportedRun) -> Panel | None:
    """Return the panel; None for a run without sets of defences that have results."""
    reported = run.defended_sets()
    if not reported:
        return None
    sets = [of_set.defended for of_set in reported]
    sheets = defence_sheets(sets, run.folder.head.hazards)
    shown_sheets = [_shortened(sheet) for sheet in sheets if sheet.name in _SHEETS_SHOWN and sheet.lines]
    manifest = manifest_if_any(run.folder, run.workspace)
    sentences = [*describe_sets(sets, manifest.step_s if manifest else None)]
    return Panel(
        anchor="defences",
        link="Defences",
        markdown="\n\n".join(["## Defences", *sentences, *(_as_markdown(sheet) for sheet in shown_sheets)]),
        html=rendered(
            _HTML_TEMPLATE,
            sentences=sentences,
            reported=reported,
            sheets=shown_sheets,
        ),
        summary=_summary(sets),
        files=sheet_csv_and_markdown_files([sheet for sheet in sheets if sheet.lines])
        | {name: data for of_set in reported for name, data in _files_of_pairs(of_set).items()},
        style="report/defences.css",
        script="report/defences.js",
    )


def _shortened(sheet: Sheet) -> Sheet:
    """Return the table with the first lines of each set, if it has a line for each experiment."""
    if sheet.name != "unneeded_activations":
        return sheet
    lines = [
        line
        for _, of_set in groupby(sheet.lines, key=itemgetter(0))
        for line in islice(of_set, _MOST_LINES_OF_SET)
    ]
    if len(lines) == len(sheet.lines):
        return sheet
    which = f"The first {_MOST_LINES_OF_SET} of each set"
    note = f"{sheet.note} {which}; all {len(sheet.lines)} are in `tables/{sheet.name}.csv`."
    return replace(sheet, lines=tuple(lines), note=note)


def _files_of_pairs(reported: ReportedSet) -> dict[str, bytes]:
    """Return the comparison of the undefended run with that of a set, drive by drive."""
    defended, comparison = reported.defended, reported.comparison
    report = defended.defended.folder.path / REPORT_FOLDER / "index.html"
    of_set = f"../../../{DEFENDED_FOLDER}/{quote(defended.name)}/{REPORT_FOLDER}/index.html"
    addresses = ReportAddresses(a="../../index.html", b=of_set if report.is_file() else "")
    folder = f"{DEFENDED_FOLDER}/{defended.name}"
    return {
        reported.page_name: render_html_page(comparison, addresses).encode(),
        f"{folder}/pairs.csv": pairs_csv(comparison),
        f"{folder}/unmatched.csv": unmatched_csv(comparison),
    }


def _as_markdown(sheet: Sheet) -> str:
    return sheet.as_markdown().replace("## ", "### ", 1).rstrip()


def _summary(sets: Sequence[DefendedSet]) -> TextTable:
    rows = [
        [
            defended.name,
            str(len(hazardous_pairs(defended))),
            str(defended.count_by_outcome[PairOutcome.PREVENTED]),
            str(defended.count_by_outcome[PairOutcome.OPEN]),
            str(defended.count_by_outcome[PairOutcome.CAUSED]),
        ]
        for defended in sets
    ]
    return TextTable(heads=["defences", "hazards", "prevented", "open", "caused"], rows=rows)
