"""The panel of families: shares over their concrete scenarios, and maps that the page's scripts draw."""

import math
from typing import Any

from markupsafe import Markup

from mutator._common.hashing import as_json_types
from mutator._common.message_text import counted
from mutator._common.table_rendering import TextTable
from mutator.report.family_results import FamilyResults, results_by_family
from mutator.report.panel import Panel, rendered
from mutator.report.panels.tables_panel import sheet_csv_and_markdown_files
from mutator.report.reported_run import ReportedRun
from mutator.statistics.family_statistics import (
    GOLDEN_HAZARDS_COLUMN,
    GOLDEN_METRIC_PREFIX,
    families_sheet,
)
from mutator.web import packed_script_element

_INTRODUCTION = (
    "Shares of the experiments in a family's concrete scenarios. Experiments of one scenario are alike, so "
    "the 95 % intervals resample whole scenarios (bootstrap); there is none below ten scenarios, or "
    "if all have the same share."
)
_INTRODUCTION_WITHOUT_RATES = (
    "Counts of the experiments in a family's concrete scenarios. Their choice decides the counts, so these "
    "are no rates."
)
_WEIGHTED_NOTE = (
    "The weighted share is that of experiments in scenarios as often as they occur on the road: each counts "
    "by how often its values occur, relative to how often they are drawn."
)
MOST_GOLDENS_ON_PAGE = 5_000  # golden runs of a family in the plot of margins: those with hazards first
_HTML_TEMPLATE = """\
<h2>Families</h2>
{% if about %}
<p>{{ about }}</p>
{% endif %}
{% for family, note, table in families %}
<details class="table"{{ " open" if loop.first }}>
<summary><h3>{{ family.facts.name }}: {{ family.facts.title }}</h3></summary>
<p>{{ note }}</p>
{% if table %}
{{ table.as_html("plain") }}
{% endif %}
</details>
{% endfor %}
<div id="family-plots" class="no-print"></div>
{{ data }}
"""


def build_families_panel(run: ReportedRun) -> Panel | None:
    """Return the panel; None for a run without families."""
    families = results_by_family(run)
    if not families:
        return None
    introduction = _INTRODUCTION if run.has_rates else _INTRODUCTION_WITHOUT_RATES
    about = introduction if any(family.experiment_count for family in families) else ""
    parts = ["## Families", *filter(None, (about,))]
    listed = []
    for family in families:
        note, table = _note(family, run.has_rates), _outcomes_table(family, run.has_rates)
        parts += [f"### {family.facts.name}", f"{family.facts.title}. {note}"]
        parts += [table.as_markdown()] if table else []
        listed.append((family, note, table))
    parts.append("The maps of results and margins over the parameters are in `index.html`.")
    shares = {family.facts.name: family.shares for family in families}
    files = sheet_csv_and_markdown_files([families_sheet(shares)]) if run.has_rates else {}
    html = rendered(
        _HTML_TEMPLATE,
        about=about,
        families=listed,
        data=Markup(packed_script_element(_page_data(run, families), "family-data")),
    )
    return Panel(
        anchor="families",
        link="Families",
        markdown="\n\n".join(parts),
        html=html,
        files=files,
    )


def _note(family: FamilyResults, has_rates: bool) -> str:
    golden = family.scenarios[GOLDEN_HAZARDS_COLUMN]
    run_count, hazard_count = int(golden.notna().sum()), int((golden.fillna("") != "").sum())
    parts = [
        f"{counted(len(family.scenarios), 'concrete scenario')}, "
        f"{counted(family.experiment_count, 'experiment')}."
    ]
    if run_count:
        parts.append(f"Without a fault, {hazard_count} of {counted(run_count, 'scenario')} had a hazard.")
    if family.frequency_source and has_rates:
        source = " ".join(family.frequency_source.split()).rstrip(".")
        parts.append(f"{_WEIGHTED_NOTE} Source: {source}.")
    return " ".join(parts)


def _outcomes_table(family: FamilyResults, has_rates: bool) -> TextTable | None:
    """Return the table of shares, or of counts where there are no rates; None without experiments."""
    if not family.experiment_count:
        return None
    if not has_rates:
        counts = [[share.what, f"{share.share.count}/{share.share.of}"] for share in family.shares]
        return TextTable(heads=["what", "experiments"], rows=counts)
    heads = ["what", "share", *(["weighted share"] if family.frequency_source else [])]
    rows = [
        [share.what, str(share.share), *([str(share.weighted)] if share.weighted else [])]
        for share in family.shares
    ]
    return TextTable(heads=heads, rows=rows)


def _page_data(run: ReportedRun, families: list[FamilyResults]) -> dict[str, Any]:
    """Return parameters and, for each golden run that is known, their values, hazards and metrics."""
    metrics = [
        {"name": m.name, "unit": "" if m.unit == "-" else m.unit, "about": m.about, "worse": m.worse}
        for m in run.folder.head.metrics
    ]
    return {
        "metrics": metrics,
        "families": [
            {**as_json_types(family.facts), "goldens": _goldens_data(family, [m["name"] for m in metrics])}
            for family in families
        ],
    }


def _goldens_data(family: FamilyResults, metrics: list[str]) -> dict[str, Any]:
    """Return the golden runs as columns; of very many, those with hazards first."""
    golden = family.scenarios[family.scenarios[GOLDEN_HAZARDS_COLUMN].notna()]
    by_hazard = golden.sort_values(GOLDEN_HAZARDS_COLUMN, key=lambda names: names == "", kind="stable")
    listed = by_hazard[:MOST_GOLDENS_ON_PAGE]
    columns = {p.key: listed[p.key].tolist() for p in family.facts.parameters}
    values = {
        name: [_rounded(value) for value in listed[column].tolist()]
        for name in metrics
        if (column := f"{GOLDEN_METRIC_PREFIX}{name}") in listed and listed[column].notna().any()
    }
    return {
        "scenarios": listed.index.tolist(),
        "hazards": listed[GOLDEN_HAZARDS_COLUMN].tolist(),
        "parameters": columns,
        "metrics": values,
        "of": len(golden),
    }


def _rounded(value: float) -> float | None:
    return float(f"{value:.4g}") if math.isfinite(value) else None
