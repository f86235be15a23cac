"""The panel of defences: what would have saved the worst, what it costs, and what it caused."""

from collections.abc import Iterable, Sequence
from urllib.parse import quote

from mutator._common.message_text import counted
from mutator._common.table_rendering import TextTable
from mutator.comparison.comparison_files import pairs_csv, render_html_page, unmatched_csv
from mutator.comparison.comparison_replays import ReportAddresses
from mutator.comparison.defended_pairs import DefendedPair, PairOutcome
from mutator.comparison.defended_sets import DefendedSet, load_defended_sets
from mutator.comparison.defended_sheets import defence_sheets, prevented_share
from mutator.comparison.run_comparison_and_gates import compare_loaded_runs
from mutator.report.panel import REPORT_FOLDER, Panel, rendered
from mutator.report.panels.tables_panel import sheet_csv_and_markdown_files
from mutator.report.reported_run import ReportedRun, manifest_if_any
from mutator.statistics.statistics_sheet import Sheet
from mutator.store.allowed_contents import DEFENDED_FOLDER
from mutator.targets.overhead_view_json import scene_as_json

_SHEETS_SHOWN = (
    "defences",
    "defence_rates",
    "defended_hazards",
    "defended_severity",
    "defence_authority",
    "defences_without_faults",
)
_HTML_TEMPLATE = """\
<h2>Defences</h2>
{% for sentence in sentences %}
<p>{{ sentence }}</p>
{% endfor %}
<ul>
{% for name in names %}
<li><a href="{{ page_name(name) | urlencode }}">{{ name }}</a>: each drive beside the undefended one</li>
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
    sets = load_defended_sets(run.folder)
    if not sets:
        return None
    sheets = defence_sheets(sets, run.folder.head.hazards)
    unfolded = [sheet for sheet in sheets if sheet.name in _SHEETS_SHOWN and sheet.lines]
    sentences = [*_sentences(sets)]
    return Panel(
        anchor="defences",
        link="Defences",
        markdown="\n\n".join(["## Defences", *sentences, *(_as_markdown(sheet) for sheet in unfolded)]),
        html=rendered(
            _HTML_TEMPLATE,
            sentences=sentences,
            names=[defended.name for defended in sets],
            sheets=unfolded,
            page_name=_page_name,
        ),
        summary=_summary(sets),
        files=sheet_csv_and_markdown_files([sheet for sheet in sheets if sheet.lines])
        | {name: data for defended in sets for name, data in _files_of_pairs(run, defended).items()},
    )


def _page_name(set_name: str) -> str:
    return f"{DEFENDED_FOLDER}/{set_name}/index.html"


def _files_of_pairs(run: ReportedRun, defended: DefendedSet) -> dict[str, bytes]:
    """Return the comparison of the undefended run with that of a set, drive by drive."""
    manifest = manifest_if_any(run.folder, run.workspace)
    scene = scene_as_json(manifest) if manifest else None
    comparison = compare_loaded_runs(defended.undefended, defended.defended, scenes=(scene, scene))
    report = defended.defended.folder.path / REPORT_FOLDER / "index.html"
    of_set = f"../../../{DEFENDED_FOLDER}/{quote(defended.name)}/{REPORT_FOLDER}/index.html"
    addresses = ReportAddresses(a="../../index.html", b=of_set if report.is_file() else "")
    folder = f"{DEFENDED_FOLDER}/{defended.name}"
    return {
        _page_name(defended.name): render_html_page(comparison, addresses).encode(),
        f"{folder}/pairs.csv": pairs_csv(comparison),
        f"{folder}/unmatched.csv": unmatched_csv(comparison),
    }


def _as_markdown(sheet: Sheet) -> str:
    return sheet.as_markdown().replace("## ", "### ", 1).rstrip()


def _sentences(sets: Sequence[DefendedSet]) -> Iterable[str]:
    """Say first what saves most of the worst, then what it costs, then what defences caused."""
    severity = max(
        (pair.undefended.severity for defended in sets for pair in _hazardous(defended)), default=""
    )
    worst = {
        defended.name: [pair for pair in _hazardous(defended) if pair.undefended.severity == severity]
        for defended in sets
    }
    what = f"hazards of severity {severity}" if severity else "hazards"
    count_by_name = {
        name: sum(pair.outcome is PairOutcome.PREVENTED for pair in pairs) for name, pairs in worst.items()
    }
    best = max(
        sets,
        key=lambda defended: (
            count_by_name[defended.name],
            defended.count_by_outcome[PairOutcome.PREVENTED],
            len(worst[defended.name]),
        ),
    )
    of, prevented = len(worst[best.name]), prevented_share(best)
    if not of and any(defended.lost_count for defended in sets):
        yield "No undefended run with a hazard has a result with defences."
    elif not of:
        yield "No undefended run has a hazard, so there was nothing to prevent."
    elif not prevented.count:
        yield "No set prevents any hazard."
    else:
        yield (
            f"`{best.name}` prevents most of the worst: {count_by_name[best.name]} of {of} {what}, and "
            f"{prevented} of all hazards."
            if count_by_name[best.name]
            else f"No set prevents any of the {of} worst {what}. Of all hazards, `{best.name}` prevents "
            f"most: {prevented}."
        ) + _open_text(best)
        yield _cost_sentence(best)
    for defended in sets:
        if defended.missing_count:
            missing = counted(defended.missing_count, "experiment")
            yield f"`{defended.name}` is not finished: {missing} without a result are left out."
        if defended.lost_count:
            lost_text = counted(defended.lost_count, "run")
            yield f"With `{defended.name}`, {lost_text} of experiments with a hazard cannot be compared."
        if defended.caused_goldens:
            runs = ", ".join(defended.caused_goldens)
            yield f"`{defended.name}` causes a hazard without any fault: in {runs}."
    yield _caused_sentence(sets)


def _hazardous(defended: DefendedSet) -> list[DefendedPair]:
    return [
        pair
        for pair in defended.pairs
        if pair.undefended.hazards and pair.outcome is not PairOutcome.NOT_COMPARED
    ]


def _cost_sentence(defended: DefendedSet) -> str:
    unneeded = sum(pair.is_unneeded_activation for pair in defended.pairs)
    without = sum(pair.outcome in (PairOutcome.NO_HAZARD, PairOutcome.CAUSED) for pair in defended.pairs)
    return (
        f"It also acts in {counted(len(defended.false_goldens), 'fault-free drive')}, and in {unneeded} of "
        f"{counted(without, 'experiment')} that had no hazard without it."
    )


def _open_text(defended: DefendedSet) -> str:
    count = defended.count_by_outcome[PairOutcome.OPEN]
    return f" In {count} more, no hazard came, but the drive ends too early to say more." if count else ""


def _caused_sentence(sets: Sequence[DefendedSet]) -> str:
    """Say how many hazards each set caused, with the worst of each."""
    caused = {defended.name: defended.select(PairOutcome.CAUSED) for defended in sets}
    parts = [_caused_text(name, pairs) for name, pairs in caused.items() if pairs]
    if not parts:
        return "No set caused a hazard in an experiment that had none."
    listed = "; ".join(parts)
    return f"Hazards in experiments that had none: {listed}. All are in `tables/defended_pairs.csv`."


def _caused_text(name: str, pairs: Sequence[DefendedPair]) -> str:
    worst = pairs[0]
    hazards = ", ".join(hazard for hazard, _ in worst.defended.hazards)
    return (
        f"`{name}` caused {len(pairs)}, the worst of them {hazards} with {worst.undefended.fault} in "
        f"{worst.undefended.scenario_label} (`{worst.undefended.experiment_id}`)"
    )


def _summary(sets: Sequence[DefendedSet]) -> TextTable:
    rows = [
        [
            defended.name,
            str(len(_hazardous(defended))),
            str(defended.count_by_outcome[PairOutcome.PREVENTED]),
            str(defended.count_by_outcome[PairOutcome.OPEN]),
            str(defended.count_by_outcome[PairOutcome.CAUSED]),
        ]
        for defended in sets
    ]
    return TextTable(heads=["defences", "hazards", "prevented", "open", "caused"], rows=rows)
