"""The first panel of a report, which answers a reader's first questions."""

import re
from collections.abc import Mapping

from markupsafe import Markup

from mutator._common.table_rendering import TextTable
from mutator.report.answer_parts import AnswerTable, Cell, ExplainedCodes, PageLink, ShareBar
from mutator.report.answers import build_answers
from mutator.report.glossary import Words, meanings_of
from mutator.report.panel import Panel, rendered
from mutator.report.reported_run import ReportedRun

_HTML = """\
<div class="answers">
{% for column in columns %}
<div class="column">
{% for answer in column %}
<section class="answer {{ answer.name }}" aria-labelledby="answer-{{ answer.name }}">
<h2 id="answer-{{ answer.name }}">{{ answer.title }}</h2>
<p>{{ answer.paragraph }}
{% for link in answer.links %}
<a href="#{{ link.fragment }}">{{ link.text }}</a>{{ "" if loop.last else ", " }}
{% endfor %}</p>
{% for answer_table in answer.tables if answer_table.rows %}
{{ table(answer_table) }}
{% endfor %}
</section>
{% endfor %}
</div>
{% endfor %}
</div>
"""
_BAR = '<span class="meter" style="--share: {:.3f}"></span><span class="of">{}</span>'


def build_answers_panel(run: ReportedRun) -> Panel:
    made = build_answers(run)
    parts = []
    for answer in made:
        tables = [_table(one).as_markdown() for one in answer.tables if one.rows]
        parts += [f"## {answer.title}", answer.paragraph, *tables]
    columns = [[one for one in made if one.is_wide], [one for one in made if not one.is_wide]]
    meanings = meanings_of(run)
    html = rendered(_HTML, columns=columns, table=lambda listing: _html(listing, meanings))
    return Panel(anchor="answers", link="Answers", markdown="\n\n".join(parts), html=html)


def _table(listing: AnswerTable) -> TextTable:
    rows = [[cell if isinstance(cell, str) else cell.text for cell in line] for line in listing.rows]
    return TextTable(heads=listing.heads, rows=rows)


def _html(listing: AnswerTable, meanings: Words) -> Markup:
    """Return the table as HTML. On narrow screens, each cell shows the heading of its column."""
    rows = [
        [
            _labelled(head, cell, meanings.get(head, {})) if i else _cell(cell)
            for i, (head, cell) in enumerate(zip(listing.heads, line, strict=True))
        ]
        for line in listing.rows
    ]
    return TextTable(heads=listing.heads, rows=rows).as_html("plain")


def _labelled(head: str, cell: Cell, meanings: Mapping[str, str]) -> str:
    shown = _explained(cell, meanings) if isinstance(cell, str | ExplainedCodes) else _cell(cell)
    if isinstance(cell, ExplainedCodes) and cell.prefix == head:  # e.g. "severity S2"
        return shown
    return Markup('<span class="label">{} </span>{}').format(head, shown)


def _explained(cell: str | ExplainedCodes, meanings: Mapping[str, str]) -> str:
    """Return the text of a cell, with the meanings of what it names as a tooltip."""
    names, text = (cell.codes, cell.text) if isinstance(cell, ExplainedCodes) else ((cell,), cell)
    about = "; ".join(meanings[name] for name in names if name in meanings)
    return Markup('<abbr title="{}">{}</abbr>').format(about, text) if about else text


def _cell(cell: Cell) -> str:
    if isinstance(cell, PageLink):
        text = Markup("<wbr>").join(re.split(r"(?<=[/_])", cell.text))  # long names can break here
        return Markup('<a href="#{}">{}</a>').format(cell.fragment, text)
    if isinstance(cell, ShareBar):
        return Markup(_BAR).format(cell.part / cell.whole if cell.whole else 0.0, cell.text)
    return cell if isinstance(cell, str) else cell.text
