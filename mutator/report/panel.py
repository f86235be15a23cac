"""Panels: the parts of a report, each in Markdown and in HTML, and the pages that they are on."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from mutator._common.message_text import with_unbreakable_numbers
from mutator._common.table_rendering import TextTable
from mutator.web.html_templates import html_environment

if TYPE_CHECKING:
    from markupsafe import Markup

REPORT_FOLDER = "report"  # the report's folder in a run folder


@dataclass(frozen=True, slots=True, kw_only=True)
class Panel:
    """One part of a report. `link` is its name in the navigation bar, `summary` the table that the command
    line shows, `style` a CSS file that it needs, `script` one that adds to the list of experiments. `files`
    are written next to the report, by name.
    """

    anchor: str  # its id on the page
    link: str
    markdown: str
    html: "Markup"
    summary: TextTable | None = None
    files: Mapping[str, bytes] = field(default_factory=dict)
    style: str = ""
    script: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportPage:
    """A page beside the report. `link` is its name in the navigation bar; `about` says what it shows."""

    file_name: str
    link: str
    title: str
    about: str
    panels: Sequence[Panel]


def rendered(template: str, **values: Any) -> "Markup":
    """Render a Jinja template as HTML. Values that are not Markup are escaped."""
    from markupsafe import Markup

    # numbers are bound to their units in text, not in HTML
    environment = html_environment(
        lambda value: with_unbreakable_numbers(value) if type(value) is str else value
    )
    environment.filters["marked"] = render_note
    return Markup(environment.from_string(template).render(**values))


def render_note(text: str) -> "Markup":
    """Render a Markdown note as HTML; only `code` and *emphasis* are supported."""
    from markupsafe import Markup, escape

    html = re.sub(r"`([^`]+)`", r"<code>\1</code>", str(escape(text)))
    return Markup(re.sub(r"\*(?=\S)([^*]+)(?<=\S)\*", r"<em>\1</em>", html))
