"""The two forms of a report: Markdown for reading anywhere, one HTML page without outside help."""

import base64
from pathlib import Path
from typing import TYPE_CHECKING

from mutator._common.tables import Table
from mutator._common.text import counted
from mutator.model import Outcome, Status
from mutator.web import asset

if TYPE_CHECKING:
    from mutator.report.building import Content

LISTED, PAGE_LISTED = 30, 200  # failed runs that the Markdown and the page list; the page can find all
STYLES = ("base.css", "report.css")
SCRIPTS = (  # each uses those before it
    "packed.js",
    "dom.js",
    "diff.js",
    "rows.js",
    "state.js",
    "filters.js",
    "heat.js",
    "grid.js",
    "details.js",
    "series.js",
    "experiment.js",
    "report.js",
)

NOTES = """\
*Injected* counts the experiments that say something about their fault; a harness error, or a mutant that
could not be made, is counted apart. *Activated*: an injected statement ran while triggered. *Manifested*: an
actuator output then differed from the fault-free run. *Hazard, no alert*: no counted alert at all."""


def markdown(content: "Content") -> str:
    """The report as Markdown."""
    parts = [f"# {content.name}"]
    if content.engine and content.engine.failed:
        parts.append(f"**{content.engine.proof}**")
    parts.append(f"{_outcome_text(content)} {content.planned}")
    if content.observations:
        parts += ["## The paper's observations", content.observations.coverage, content.observations.verdicts]
        parts.append("Their claims, rules, numbers and queries are in [observations.md](observations.md).")
    parts += [NOTES.replace("\n", " ")]
    for table in content.tables:
        parts += [f"## {table.title}", table.table.as_markdown()]
    parts += [sheet.markdown().rstrip() for sheet in content.statistics]
    if content.figures:
        parts.append("## Figures")
    for drawing in content.figures:
        parts += [f"### {drawing.title}", drawing.note]
        parts += [f"{what}: `{code}`" for what, code in drawing.codes]
        if drawing.figure is not None:
            parts.append(f"![{drawing.title}]({drawing.link('svg')})")
    if content.failed:
        parts += ["## Runs that did not end well", _failed_text(content)]
    if content.engine:
        parts += ["## How the experiments were run", content.engine.proof]
        parts.append(content.engine.table.as_markdown())
    parts += [
        "## Where this comes from",
        Table(heads=("what", "value"), rows=content.facts).as_markdown(),
    ]
    parts.append("The table of all experiments is `results.csv`; `index.html` lists them with their diffs.")
    return "\n\n".join(parts) + "\n"


def _outcome_text(content: "Content") -> str:
    total = sum(content.outcomes.values())
    return (
        f"{counted(total, 'experiment')}: "
        + ", ".join(f"{n} {name}" for name, n in content.outcomes.items())
        + "."
    )


def _failed_text(content: "Content") -> str:
    lines = [
        [r.status.value, r.experiment_id, r.fault, r.scenario, r.detail] for r in content.failed[:LISTED]
    ]
    heads = ("status", "experiment", "fault", "scenario", "what was said")
    table = Table(heads=heads, rows=lines).as_markdown()
    more = len(content.failed) - LISTED
    return f"{table}\n\n{more} more are in `results.csv`." if more > 0 else table


def page(content: "Content", out: Path) -> str:
    """The report as one HTML page that needs no other file; every text in it is escaped.

    The figures have been written into the folder `out`.
    """
    from jinja2 import Environment, StrictUndefined
    from markupsafe import Markup

    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    return environment.from_string(asset("report.html")).render(
        content=content,
        notes=NOTES.replace("*", ""),
        listed=PAGE_LISTED,
        outcomes=[outcome.value for outcome in Outcome],
        failings=[status.value for status in Status if status is not Status.OK],
        picture=lambda drawing: _picture(out / drawing.link("svg")),
        styles=[Markup(asset(name)) for name in STYLES],
        scripts=[Markup(asset(name)) for name in SCRIPTS],
    )


def _picture(path: Path) -> str:
    """The figure itself as an address, so that the page needs no file beside it."""
    return f"data:image/svg+xml;base64,{base64.b64encode(path.read_bytes()).decode()}"
