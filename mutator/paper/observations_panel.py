"""Judges the published observations by a run's results, and shows the verdicts in the report."""

import re
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from mutator._common.bounded_reading import read_bounded
from mutator._common.message_text import counted
from mutator.config.yaml_files import MOST_YAML_BYTES
from mutator.outcomes.fault_free_runs import fault_free_alerts_note
from mutator.paper import observation_judging, observations_by_seed, observations_markdown_and_table
from mutator.paper.observation_judging import ClaimVerdict
from mutator.paper.published_numbers import has_published_numbers, load_published_numbers
from mutator.report.panel import Panel, rendered
from mutator.report.panels.tables_panel import sheet_csv_files
from mutator.report.reported_run import ReportedRun
from mutator.statistics.results_frame import select_common_columns

if TYPE_CHECKING:
    import pandas as pd

MARKDOWN_FILE = "observations.md"
_HTML_TEMPLATE = """\
<h2>The paper's observations</h2>
<p>{{ coverage }}</p>
{% for observation in observations %}
<details class="table"{{ " open" if observation.verdict.value != undecided }}>
<summary><h3>{{ observation.number }}. {{ observation.title }}
<span class="verdict">{{ observation.verdict.value }}</span></h3></summary>
{{ table(observation).as_html() }}
<details><summary>Queries</summary>
<pre>{{ session }}

{% for claim in observation.claims %}
# {{ claim.number }} {{ claim.claim.claim_text }}
{% for answer in claim.answers %}
{{ answer.query }}
{% else %}
# {{ claim.reason }}
{% endfor %}
{% endfor %}
</pre></details>
</details>
{% endfor %}
<p>{{ rules | marked }}</p>{% if of_seeds %}

<h3>Seed by seed</h3>
<p>{{ about_seeds }}</p>
{{ of_seeds.as_html() }}
{% endif %}
"""


def build_observations_panel(run: ReportedRun) -> Panel | None:
    """Return the panel of the observations that the library cites, with observations.md and tables.

    None if the library cites no observations, if the run has none of the published fault types, or if its
    experiments decide no observation. Decided observations come first.
    """
    if run.workspace is None:
        return None
    references = run.workspace.references
    file = references / observation_judging.FILE_NAME
    if not (file.is_file() and has_published_numbers(references)):
        return None
    fault_types = list(
        dict.fromkeys(kind for _, kind in load_published_numbers(references).tally_by_fault_type)
    )
    missing = _missing_fault_types(fault_types, run.frame)
    if len(missing) == len(fault_types):
        return None
    ends = run.latest_golden_end_by_scenario() or {}
    file_words = re.findall(r"\w+", read_bounded(file, MOST_YAML_BYTES).decode())
    frame = select_common_columns(run.frame, *file_words)  # the queries use only columns that the file names
    frame = frame.assign(t_end=frame["scenario"].map(ends))  # `median_time` needs the ends of the runs
    judged = observation_judging.judge_observations(
        file, frame, list(_differences_from_papers_mixture(run, missing))
    )
    coverage = _describe_coverage(run, len(fault_types), missing)
    if all(observation.verdict is ClaimVerdict.UNDECIDED for observation in judged):
        return None
    ends_by_scenario = tuple(sorted(ends.items()))
    by_seed = observations_by_seed.judge_by_seed(
        file,
        frame,
        lambda runs: list(_differences_from_papers_mixture(run, _missing_fault_types(fault_types, runs))),
    )
    seeds_table = observations_by_seed.verdicts_by_seed_table(judged, by_seed) if by_seed else None
    sheets = [
        observations_markdown_and_table.observations_sheet(judged),
        *([observations_by_seed.observations_by_seed_sheet(by_seed)] if by_seed else ()),
    ]
    text = observations_markdown_and_table.render_observations_markdown(judged, ends_by_scenario, coverage)
    parts = [
        "## The paper's observations",
        coverage,
        observations_markdown_and_table.verdicts_markdown(judged),
        *(
            ("### Seed by seed", observations_by_seed.SEEDS_NOTE, seeds_table.as_markdown())
            if seeds_table
            else ()
        ),
        f"The claims, rules, numbers and queries are in [{MARKDOWN_FILE}]({MARKDOWN_FILE}).",
    ]
    html = rendered(
        _HTML_TEMPLATE,
        coverage=coverage,
        observations=sorted(judged, key=lambda observation: observation.verdict is ClaimVerdict.UNDECIDED),
        undecided=ClaimVerdict.UNDECIDED.value,
        table=observations_markdown_and_table.claims_table,
        session=observations_markdown_and_table.session_setup_code(ends_by_scenario),
        rules=observations_markdown_and_table.rules_text(),
        of_seeds=seeds_table,
        about_seeds=observations_by_seed.SEEDS_NOTE,
    )
    return Panel(
        anchor="observations",
        link="Observations",
        markdown="\n\n".join(parts),
        html=html,
        summary=seeds_table,
        files={MARKDOWN_FILE: text.encode(), **sheet_csv_files(sheets)},
    )


def _missing_fault_types(fault_types: Sequence[str], runs: "pd.DataFrame") -> list[str]:
    return sorted(set(fault_types) - set(runs["kind"].unique()))


def _differences_from_papers_mixture(run: ReportedRun, missing_fault_types: list[str]) -> Iterator[str]:
    """Yield how the run differs from the paper's mixture of faults. A shard is always incomplete."""
    if (sample := run.sampled_plan) and sample.is_even:
        yield "the experiments are an even sample"
    if missing_fault_types:
        yield f"no runs of {counted(len(missing_fault_types), 'fault type')} of the paper"
    if run.ran_count < (planned := run.folder.head.experiments):
        yield f"only {run.ran_count} of {planned} planned experiments were run"


def _describe_coverage(run: ReportedRun, fault_type_count: int, missing: list[str]) -> str:
    text = f"Based on {len(run.frame)} of {run.folder.planned_experiment_count} experiments, which cover "
    text += f"{fault_type_count - len(missing)} of the paper's {fault_type_count} fault types."
    text += f" Missing: {', '.join(missing)}." if missing else ""
    return " ".join(filter(None, (text, fault_free_alerts_note(run.fault_free_runs()))))
