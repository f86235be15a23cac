"""The panel of the mutation score: the share of operator mutants that change the closed loop. Runs without
operators have no such panel.
"""

from dataclasses import replace

from mutator.model import OPERATOR_FAULTS_MODULE
from mutator.outcomes.fault_free_runs import alerts_by_scenario_and_seed
from mutator.report.panel import Panel, rendered
from mutator.report.panels.tables_panel import sheet_csv_and_markdown_files
from mutator.report.reported_run import ReportedRun
from mutator.statistics.mutation_score import mutation_score_sheet
from mutator.statistics.statistics_sheet import Sheet
from mutator.store import plan_file

_HTML_TEMPLATE = """\
<h2>{{ score.title }}</h2>
<p>{{ score.note | marked }}</p>
{{ general.table().as_html("score") }}
<details class="table">
<summary><h3>By function</h3></summary>
{{ functions.table().as_html("score") }}
</details>
"""


def build_mutation_score_panel(run: ReportedRun) -> Panel | None:
    """Return the panel with the shares in total and by operator."""
    if not (run.results["module"] == OPERATOR_FAULTS_MODULE).any():
        return None
    runs = run.fault_free_runs()
    score = mutation_score_sheet(
        run.frame,
        plan_file.load_faults(run.folder.path),
        alerts_by_scenario_and_seed(runs) if runs else None,
        run.folder.head.operators,
    )
    html = rendered(
        _HTML_TEMPLATE,
        score=score,
        general=_select_score_lines(score, False),
        functions=_select_score_lines(score, True),
    )
    return Panel(
        anchor="score",
        link="Score",
        markdown=score.as_markdown().rstrip(),
        html=html,
        style="report/source.css",
        files=sheet_csv_and_markdown_files([score]),
    )


def _select_score_lines(score: Sheet, of_functions: bool) -> Sheet:
    """Return the lines of functions if `of_functions`; otherwise all other lines."""
    return replace(score, lines=tuple(line for line in score.lines if ("::" in str(line[0])) == of_functions))
