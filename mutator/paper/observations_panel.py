"""Judges the published observations by a run's results, and shows the verdicts in the report."""

import re
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from mutator._common.bounded_reading import read_bounded
from mutator._common.message_text import counted
from mutator.config.yaml_files import MAX_BYTES
from mutator.outcomes.fault_free_runs import own_alerts
from mutator.paper import observations, observations_by_seed, observations_page
from mutator.paper.observations import Verdict
from mutator.paper.published_numbers import has_paper, load_paper
from mutator.report.panel import Panel, rendered
from mutator.report.panels.tables_panel import csv_files
from mutator.report.reported_run import ReportedRun
from mutator.statistics.results_frame import select_columns

if TYPE_CHECKING:
    import pandas as pd

FILE = "observations.md"
_HTML = """\
<h2>The paper's observations</h2>
<p>{{ coverage }}</p>
{% for one in observations %}
<details class="table"{{ " open" if one.verdict.value != undecided }}>
<summary><h3>{{ one.number }}. {{ one.title }}
<span class="verdict">{{ one.verdict.value }}</span></h3></summary>
{{ table(one).as_html() }}
<details><summary>Queries</summary>
<pre>{{ session }}

{% for claim in one.claims %}
# {{ claim.number }} {{ claim.claim.says }}
{% for answer in claim.answers %}
{{ answer.query }}
{% else %}
# {{ claim.why }}
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
    file = references / observations.FILE
    if not (file.is_file() and has_paper(references)):
        return None
    kinds = list(dict.fromkeys(kind for _, kind in load_paper(references).coverage))
    missing = _missing(kinds, run.frame)
    if len(missing) == len(kinds):
        return None
    ends = run.ends() or {}
    words = re.findall(r"\w+", read_bounded(file, MAX_BYTES).decode())
    frame = select_columns(run.frame, *words)  # the queries use only columns that the file names
    frame = frame.assign(t_end=frame["scenario"].map(ends))
    judged = observations.judge(file, frame, list(_lacks(run, missing)))
    coverage = _coverage(run, len(kinds), missing)
    if all(one.verdict is Verdict.UNDECIDED for one in judged):
        return None
    shown_ends = tuple(sorted(ends.items()))
    by_seed = observations_by_seed.judge_by_seed(
        file, frame, lambda runs: list(_lacks(run, _missing(kinds, runs)))
    )
    of_seeds = observations_by_seed.table(judged, by_seed) if by_seed else None
    sheets = [observations_page.sheet(judged), *([observations_by_seed.sheet(by_seed)] if by_seed else ())]
    text = observations_page.markdown(judged, shown_ends, coverage)
    parts = [
        "## The paper's observations",
        coverage,
        observations_page.verdicts(judged),
        *(("### Seed by seed", observations_by_seed.ABOUT, of_seeds.as_markdown()) if of_seeds else ()),
        f"The claims, rules, numbers and queries are in [{FILE}]({FILE}).",
    ]
    html = rendered(
        _HTML,
        coverage=coverage,
        observations=sorted(judged, key=lambda one: one.verdict is Verdict.UNDECIDED),
        undecided=Verdict.UNDECIDED.value,
        table=observations_page.table,
        session=observations_page.session(shown_ends),
        rules=observations_page.rules(),
        of_seeds=of_seeds,
        about_seeds=observations_by_seed.ABOUT,
    )
    return Panel(
        anchor="observations",
        link="Observations",
        markdown="\n\n".join(parts),
        html=html,
        summary=of_seeds,
        files={FILE: text.encode(), **csv_files(sheets)},
    )


def _missing(kinds: Sequence[str], runs: "pd.DataFrame") -> list[str]:
    return sorted(set(kinds) - set(runs["kind"].unique()))


def _lacks(run: ReportedRun, missing: list[str]) -> Iterator[str]:
    """Yield how the run differs from the paper's mixture of faults. A shard is always incomplete."""
    if missing:
        yield f"no runs of {counted(len(missing), 'fault type')} of the paper"
    if run.done < (planned := run.folder.head.experiments):
        yield f"only {run.done} of {planned} planned experiments were run"


def _coverage(run: ReportedRun, kinds: int, missing: list[str]) -> str:
    text = f"Based on {len(run.frame)} of {run.folder.planned} experiments, which cover "
    text += f"{kinds - len(missing)} of the paper's {kinds} fault types."
    text += f" Missing: {', '.join(missing)}." if missing else ""
    return " ".join(filter(None, (text, own_alerts(run.fault_free()))))
