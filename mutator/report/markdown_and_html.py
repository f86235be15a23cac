"""The two forms of a report: Markdown, and one self-contained HTML page."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from mutator._common.message_text import counted
from mutator.model import Outcome
from mutator.mutants.injected_lines import tags_for_page_scripts
from mutator.report.experiment_list import ExperimentListData
from mutator.report.glossary import Glossary
from mutator.report.panel import Panel, rendered
from mutator.web import asset_text, csp_hash, json_script_element, load_order


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportContent:
    """The content of both forms of a report. `alarm` is shown first. `study_citation` cites the
    study that has its own page. `answers` come before the list of experiments, `panels` after it.
    `replays_note` says which replays a page contains that lies alone.
    """

    title: str
    alarm: str
    outcome_counts: Mapping[str, int]
    plan_text: str
    glossary: Glossary
    study_citation: str
    answers: Panel
    panels: Sequence[Panel]
    experiment_list: ExperimentListData  # the list of experiments, which only the page has
    replays_note: str = ""


def report_markdown(content: ReportContent) -> str:
    total = sum(content.outcome_counts.values())
    endings = ", ".join(f"{n} {name}" for name, n in content.outcome_counts.items())
    which = "the worst of them" if content.experiment_list.truncation_note else "them"
    parts = [
        f"# {content.title}",
        f"**{content.alarm}**" if content.alarm else "",
        f"{counted(total, 'experiment')}: {endings}. {content.plan_text}",
        content.answers.markdown,
        *(panel.markdown for panel in content.panels),
        f"Compared with the published numbers: [STUDY.md](STUDY.md) ({content.study_citation})."
        if content.study_citation
        else "",
        f"The table of all experiments is `results.csv`; `index.html` lists {which} with their diffs.",
    ]
    return "\n\n".join(filter(None, parts)) + "\n"


def report_html(content: ReportContent, *, is_alone: bool = False) -> str:
    """Return the report as one self-contained HTML page. All text is escaped. A page that lies alone is not
    allowed to request anything.
    """
    from markupsafe import Markup

    scripts = [asset_text(name) for name in load_order("report", ".js")]
    html = rendered(
        asset_text("report/report.html"),
        content=content,
        tags=Markup(json_script_element(tags_for_page_scripts(), "tags")),
        outcome_names=[outcome.value for outcome in Outcome],
        styles=[
            Markup(asset_text(name))
            for name in (
                *load_order("report", ".css"),
                *dict.fromkeys(p.style for p in content.panels if p.style),
            )
        ],
        scripts=list(map(Markup, scripts)),
        policy=_policy_without_requests(scripts) if is_alone else "",
    )
    return str(html)


def _policy_without_requests(scripts: Iterable[str]) -> str:
    hashes = " ".join(csp_hash(f"\n{script}") for script in scripts)
    return f"default-src 'none'; script-src {hashes}; style-src 'unsafe-inline'; img-src data:"


def study_markdown(content: ReportContent, panels: Sequence[Panel]) -> str:
    parts = (
        f"# {content.title}, compared with its study",
        f"{content.study_citation}.",
        *(panel.markdown for panel in panels),
    )
    return "\n\n".join(parts) + "\n"


def study_html(content: ReportContent, panels: Sequence[Panel]) -> str:
    from markupsafe import Markup

    styles = [Markup(asset_text(name)) for name in load_order("report", ".css")]
    return str(rendered(asset_text("report/study.html"), content=content, panels=panels, styles=styles))
