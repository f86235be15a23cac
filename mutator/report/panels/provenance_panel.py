"""The provenance panel: how the experiments were executed, and what is needed to reproduce them."""

from mutator._common.message_text import list_seeds
from mutator._common.table_rendering import TextTable
from mutator.audit.run_digests_and_seal import (
    UNSEALED_KEYS_BY_FILE,
    digests_or_why_no_seal,
    unsealed_facts,
    without_keys,
)
from mutator.campaigns.installed_studies import study_problems
from mutator.report.panel import Panel, rendered
from mutator.report.reported_run import ReportedRun
from mutator.store.recorded_approvals import approval_summary
from mutator.store.run_head import HEAD
from mutator.store.session_environments import describe_environments, version_texts_by_package

LISTED_PACKAGES = (
    "jinja2",
    "libcst",
    "numpy",
)  # packages that build mutants and compare runs; run.json lists all
_UNSEALED_NOTE = "The seal does not cover this. Whoever can write to the run folder can change it unnoticed."
_HTML_TEMPLATE = """\
{% if engines %}
<h2>How the experiments were run</h2>
<p>{{ engines.equivalence_text }}</p>
{{ engines.table.as_html("plain") }}
{% endif %}
<h2>Origin of the results</h2>
{{ facts.as_html("plain facts") }}
<h3>Not sealed</h3>
<p>{{ note }}</p>
{{ unsealed.as_html("plain facts") }}
"""


def build_provenance_panel(run: ReportedRun) -> Panel:
    """Return the panel with engines, equivalence check, plan, choices, sources and versions."""
    engines, facts = run.engine_summary, _provenance_facts(run)
    unsealed = list(unsealed_facts(run.folder).items())
    if run.change:
        unsealed.append(("run before", f"{run.change.name}, with which the report compares this run"))
    parts = []
    if engines:
        parts += ["## How the experiments were run", engines.equivalence_text, engines.table.as_markdown()]
    parts += ["## Origin of the results", TextTable(heads=("what", "value"), rows=facts).as_markdown()]
    parts += [
        "### Not sealed",
        _UNSEALED_NOTE,
        TextTable(heads=("what", "value"), rows=unsealed).as_markdown(),
    ]
    tables = {"facts": facts, "unsealed": unsealed}
    html = rendered(
        _HTML_TEMPLATE,
        engines=engines,
        note=_UNSEALED_NOTE,
        **{
            name: TextTable(heads=("", ""), rows=rows, has_row_headings=True) for name, rows in tables.items()
        },
    )
    return Panel(anchor="origin", link="Origin", markdown="\n\n".join(parts), html=html)


def _provenance_facts(run: ReportedRun) -> list[tuple[str, str]]:
    folder = run.folder
    reviewed = approval_summary(folder.path)
    head, packages = folder.head, version_texts_by_package(folder.session_environments)
    chosen = without_keys(head.as_json(), UNSEALED_KEYS_BY_FILE[HEAD])["choices"]
    facts = {
        "experiments": f"{len(run.results)} of {folder.planned_experiment_count} planned",
        **({"proof": run.engine_summary.equivalence_in_brief} if run.engine_summary else {}),
        **({"reviewed": reviewed} if reviewed else {}),
        **digests_or_why_no_seal(folder),
        "campaign": head.campaign,
        **_study_fact(run),
        "plan": head.plan,
        **_seeds_fact(run),
        **({"reading": head.reading} if head.reading else {}),
        **{f"chosen: {name}": value for name, value in chosen.items() if value is not None},
        **{f"digest of {name}": value for name, value in head.sources.items()},
        "mutator": head.provenance.mutator,
        **{
            name: text
            for name, text in describe_environments(folder.session_environments).items()
            if name == "python"
        },
        **{name: packages[name] for name in LISTED_PACKAGES if name in packages},
    }
    return [(name, str(value)) for name, value in facts.items()]


def _seeds_fact(run: ReportedRun) -> dict[str, str]:
    if run.folder.is_bench:  # its experiments have any seeds, not all of a range
        return {"seeds": list_seeds(map(int, run.results["seed"].unique()))}
    seeds = run.folder.seeds
    return {"seed": str(seeds[0])} if len(seeds) == 1 else {"seeds": f"{seeds[0]} to {seeds[-1]}"}


def _study_fact(run: ReportedRun) -> dict[str, str]:
    """Return the study that the campaign names, and the reason if this report is not compared with it."""
    name = run.folder.head.study
    if not name:
        return {}
    if run.published_work and run.workspace:
        problems = study_problems(name, run.published_work, run.workspace)
        not_compared = "" if run.has_study_page else "; these results cannot be compared with it"
        why = (
            f"; problem with its data (see `mutator check`): {problems[0].got}" if problems else not_compared
        )
        return {"study": f"{name} ({run.published_work.about}){why}"}
    why = "cannot be loaded here" if run.workspace else "needs a fault library, but none was found"
    return {"study": f"{name}, which {why}"}
