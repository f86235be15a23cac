"""The two forms of a report: Markdown, and one self-contained HTML page."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from mutator._common.message_text import counted
from mutator.model import Outcome
from mutator.mutants.injected_lines import tags_for_scripts
from mutator.report.experiment_list import ExperimentListData
from mutator.report.glossary import Glossary
from mutator.report.panel import Panel, rendered
from mutator.web import asset_text, json_script_element, load_order


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportContent:
    """The content of both forms of a report. `alarm` is shown first. `outcomes` counts outcomes and
    statuses. `study` cites the study that has its own page. `answers` come before the list of experiments,
    `panels` after it.
    """

    name: str
    alarm: str
    outcomes: Mapping[str, int]
    planned: str
    words: Glossary
    study: str
    answers: Panel
    panels: Sequence[Panel]
    browse: ExperimentListData  # the list of experiments, which only the page has


def report_markdown(content: ReportContent) -> str:
    total = sum(content.outcomes.values())
    endings = ", ".join(f"{n} {name}" for name, n in content.outcomes.items())
    which = "the worst of them" if content.browse.truncation_note else "them"
    parts = [
        f"# {content.name}",
        f"**{content.alarm}**" if content.alarm else "",
        f"{counted(total, 'experiment')}: {endings}. {content.planned}",
        content.answers.markdown,
        *(panel.markdown for panel in content.panels),
        f"Compared with the published numbers: [STUDY.md](STUDY.md) ({content.study})."
        if content.study
        else "",
        f"The table of all experiments is `results.csv`; `index.html` lists {which} with their diffs.",
    ]
    return "\n\n".join(filter(None, parts)) + "\n"


def report_html(content: ReportContent) -> str:
    """Return the report as one self-contained HTML page. All text is escaped."""
    from markupsafe import Markup

    html = rendered(
        asset_text("report/report.html"),
        content=content,
        tags=Markup(json_script_element(tags_for_scripts(), "tags")),
        outcome_names=[outcome.value for outcome in Outcome],
        styles=[
            Markup(asset_text(name))
            for name in (
                *load_order("report", ".css"),
                *dict.fromkeys(p.style for p in content.panels if p.style),
            )
        ],
        scripts=[Markup(asset_text(name)) for name in load_order("report", ".js")],
    )
    return str(html)


def study_markdown(content: ReportContent, panels: Sequence[Panel]) -> str:
    parts = (
        f"# {content.name}, compared with its study",
        f"{content.study}.",
        *(panel.markdown for panel in panels),
    )
    return "\n\n".join(parts) + "\n"


def study_html(content: ReportContent, panels: Sequence[Panel]) -> str:
    from markupsafe import Markup

    styles = [Markup(asset_text(name)) for name in load_order("report", ".css")]
    return str(rendered(asset_text("report/study.html"), content=content, panels=panels, styles=styles))
