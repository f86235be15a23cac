"""The panel that answers a reader's first questions, the list of the worst experiments first."""

import re
from collections.abc import Mapping

from markupsafe import Markup

from mutator._common.table_rendering import TextTable
from mutator.report.answer_parts import AnswerCell, AnswerTable, ExplainedCodes, PageLink, ShareBar
from mutator.report.panel import Panel, rendered
from mutator.report.report_answers import build_answers
from mutator.report.report_glossary import Glossary, code_meanings_by_column
from mutator.report.reported_run import ReportedRun

_HTML_TEMPLATE = """\
<div class="answers">
{% for column in columns %}
<div class="column{{ " whole" if loop.first }}">
{% for answer in column %}
<section class="answer {{ answer.html_name }}" aria-labelledby="answer-{{ answer.html_name }}">
<h2 id="answer-{{ answer.html_name }}">{{ answer.title }}</h2>
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
_BAR_HTML = '<span class="meter" style="--share: {:.3f}"></span><span class="of">{}</span>'


def build_answers_panel(run: ReportedRun) -> Panel:
    answers = build_answers(run)
    parts = []
    for answer in answers:
        tables = [_plain_table(table).as_markdown() for table in answer.tables if table.rows]
        parts += [f"## {answer.title}", answer.paragraph, *tables]
    first, *others = answers
    columns = [
        [first],
        [answer for answer in others if answer.has_wide_tables],
        [answer for answer in others if not answer.has_wide_tables],
    ]
    meanings = code_meanings_by_column(run)
    html = rendered(_HTML_TEMPLATE, columns=columns, table=lambda listing: _table_html(listing, meanings))
    return Panel(anchor="answers", link="Answers", markdown="\n\n".join(parts), html=html)


def _plain_table(answer_table: AnswerTable) -> TextTable:
    rows = [list(map(_plain_text, line)) for line in answer_table.rows]
    return TextTable(heads=answer_table.heads, rows=rows)


def _plain_text(cell: AnswerCell) -> str:
    if isinstance(cell, str):
        return cell
    return f"{cell.text} ({cell.note})" if isinstance(cell, PageLink) and cell.note else cell.text


def _table_html(answer_table: AnswerTable, meanings: Glossary) -> Markup:
    """Return the table as HTML. On narrow screens, each cell shows the heading of its column."""
    rows = [
        [
            _cell_html(cell) if cell is subject else _labelled_cell_html(head, cell, meanings.get(head, {}))
            for head, cell in zip(answer_table.heads, line, strict=True)
        ]
        for line in answer_table.rows
        if (subject := next(filter(_is_subject, line), line[0]))
    ]
    return TextTable(heads=answer_table.heads, rows=rows).as_html("plain")


def _is_subject(cell: AnswerCell) -> bool:
    """Whether a cell says what its line is about, and needs no label."""
    return isinstance(cell, PageLink) and bool(cell.note)


def _labelled_cell_html(head: str, cell: AnswerCell, meanings: Mapping[str, str]) -> str:
    html = (
        _explained_cell_html(cell, meanings) if isinstance(cell, str | ExplainedCodes) else _cell_html(cell)
    )
    if isinstance(cell, ExplainedCodes) and cell.prefix == head:  # e.g. "severity S2"
        return html
    return Markup('<span class="label">{} </span>{}').format(head, html)


def _explained_cell_html(cell: str | ExplainedCodes, meanings: Mapping[str, str]) -> str:
    """Return the text of a cell, with the meanings of what it names as a tooltip."""
    names, text = (cell.codes, cell.text) if isinstance(cell, ExplainedCodes) else ((cell,), cell)
    about = "; ".join(meanings[name] for name in names if name in meanings)
    return Markup('<abbr title="{}">{}</abbr>').format(about, text) if about else text


def _cell_html(cell: AnswerCell) -> str:
    if isinstance(cell, PageLink):
        text = Markup("<wbr>").join(re.split(r"(?<=[/_])", cell.text))  # long names can break here
        link = Markup('<a href="#{}">{}</a>').format(cell.fragment, text)
        return link + Markup('<span class="note">{}</span>').format(cell.note) if cell.note else link
    if isinstance(cell, ShareBar):
        return Markup(_BAR_HTML).format(cell.part / cell.whole if cell.whole else 0.0, cell.text)
    return cell if isinstance(cell, str) else cell.text
