"""The two forms of a report: Markdown, and one self-contained HTML page."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from mutator._common.message_text import counted
from mutator.model import Outcome
from mutator.mutants.injected_line_syntax import tags_for_page_scripts
from mutator.report.experiment_list_data import ExperimentListData
from mutator.report.panel import Panel, ReportPage, rendered
from mutator.report.report_glossary import Glossary
from mutator.web import asset_text, csp_hash, json_script_element, load_order

_START_SCRIPT = "report/report.js"


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportContent:
    """The content of both forms of a report. `alarm` is shown first, then `leading_panels`, `first_screen`
    and `answers`. `panels` come after the list of experiments. `pages` lie beside the report, as does
    `study`, the comparison with the campaign's study. `replays_note` says which replays a page contains that
    lies alone.
    """

    title: str
    alarm: str
    outcome_counts: Mapping[str, int]
    plan_text: str
    glossary: Glossary
    leading_panels: Sequence[Panel]
    first_screen: Panel
    answers: Panel
    panels: Sequence[Panel]
    pages: Sequence[ReportPage]
    study: ReportPage | None
    experiment_list: ExperimentListData  # the list of experiments, which only the page has
    replays_note: str = ""

    @property
    def all_pages(self) -> tuple[ReportPage, ...]:
        return (*self.pages, *([self.study] if self.study else ()))

    def on_one_page(self) -> "ReportContent":
        """Return the content with the panels of its pages among its own, and without the study."""
        panels = (*self.panels, *(panel for page in self.pages for panel in page.panels))
        return replace(self, panels=panels, pages=(), study=None)


def report_markdown(content: ReportContent) -> str:
    total = sum(content.outcome_counts.values())
    endings = ", ".join(f"{n} {name}" for name, n in content.outcome_counts.items())
    which = "the worst of them" if content.experiment_list.truncation_note else "them"
    parts = [
        f"# {content.title}",
        f"**{content.alarm}**" if content.alarm else "",
        f"{counted(total, 'experiment')}: {endings}. {content.plan_text}",
        *(panel.markdown for panel in content.leading_panels),
        content.first_screen.markdown,
        content.answers.markdown,
        *(panel.markdown for panel in content.on_one_page().panels),
        f"Compared with the published numbers: [STUDY.md](STUDY.md). {content.study.about}"
        if content.study
        else "",
        f"The table of all experiments is `results.csv`; `index.html` lists {which} with their diffs.",
    ]
    return "\n\n".join(filter(None, parts)) + "\n"


def report_html(content: ReportContent, *, is_alone: bool = False) -> str:
    """Return the report as one self-contained HTML page. All text is escaped. A page that lies alone is not
    allowed to request anything.
    """
    from markupsafe import Markup

    scripts = [asset_text(name) for name in _script_names(content)]
    html = rendered(
        asset_text("report/report.html"),
        content=content,
        tags=Markup(json_script_element(tags_for_page_scripts(), "tags")),
        outcome_names=[outcome.value for outcome in Outcome],
        styles=[
            Markup(asset_text(name))
            for name in (
                *load_order("report", ".css"),
                *dict.fromkeys(p.style for p in (*content.leading_panels, *content.panels) if p.style),
            )
        ],
        scripts=list(map(Markup, scripts)),
        policy=_policy_without_requests(scripts) if is_alone else "",
    )
    return str(html)


def _script_names(content: ReportContent) -> list[str]:
    """Return the scripts in load order. Those of panels add to the page before it starts."""
    names = [*load_order("report", ".js")]
    start = names.index(_START_SCRIPT)
    names[start:start] = dict.fromkeys(
        p.script for p in (*content.leading_panels, *content.panels) if p.script
    )
    return names


def _policy_without_requests(scripts: Iterable[str]) -> str:
    hashes = " ".join(csp_hash(f"\n{script}") for script in scripts)
    return f"default-src 'none'; script-src {hashes}; style-src 'unsafe-inline'; img-src data:"


def page_markdown(content: ReportContent, page: ReportPage) -> str:
    parts = (f"# {page.title}: {content.title}", page.about, *(panel.markdown for panel in page.panels))
    return "\n\n".join(parts) + "\n"


def page_html(content: ReportContent, page: ReportPage) -> str:
    """Return a page beside the report as HTML."""
    from markupsafe import Markup

    names = dict.fromkeys((*load_order("report", ".css"), *(p.style for p in page.panels if p.style)))
    styles = [Markup(asset_text(name)) for name in names]
    return str(rendered(asset_text("report/page.html"), content=content, page=page, styles=styles))
