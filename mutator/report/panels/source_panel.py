"""The panel of the source, for runs with operators: each line coloured by the worst outcome of its
mutants.
"""

import io
import keyword
import tokenize
from collections.abc import Iterator, Sequence
from urllib.parse import quote

from markupsafe import Markup, escape

from mutator._common.message_text import counted
from mutator._common.table_rendering import TextTable
from mutator.report.panel import Panel, rendered
from mutator.report.reported_run import ReportedRun
from mutator.report.source_lines_with_outcomes import (
    ENDINGS_WORST_FIRST,
    PERMANENCE_VALUES,
    LineMark,
    MarkedFile,
)

_ENDING_SIGNS = dict(zip(ENDINGS_WORST_FIRST, "HCTAMN", strict=True))  # sign shown with a mark's colour
_ENDING_MEANINGS = dict(
    zip(
        ENDINGS_WORST_FIRST,
        ("hazard", "crash", "timeout", "actuator changed", "masked: no actuator changed", "not activated"),
        strict=True,
    )
)
_MOST_LISTED_LINES = 20  # maximum number of lines listed in Markdown
_INTRODUCTION = (
    "Functions with injected faults. Each line shows the worst outcome of its permanent mutants and, next to "
    "it, of its transient ones, with the number of mutants that had it. A mutant is counted by its worst "
    "experiment; harness errors are not counted."
)
_HTML_TEMPLATE = """\
<h2>Source</h2>
{% if why %}
<p>{{ why | marked }}</p>
{% else %}
<p>{{ about }} Select a mark to list its experiments, or a line number to list those of both marks.</p>
<p class="legend">{% for ending, sign in signs.items() %}
<span><span class="ending {{ ending }}">{{ sign }}</span> {{ meanings[ending] }}</span>
{% endfor %}
<span><b>H 2/5</b> a hazard for 2 of the line's 5 mutants</span></p>
{% for file in files %}
<details class="source-file"{{ " open" if loop.first }}>
<summary><h3><code>{{ file.path }}</code></h3> <span class="quiet">{{ describe(file) }}</span></summary>
<div class="scroll" tabindex="0" role="group" aria-label="Source of {{ file.path }}">
<table class="plain source">
<thead><tr><th scope="col">line</th>{% for name in lasting %}<th scope="col">{{ name }}</th>{% endfor %}
<th scope="col">source</th></tr></thead>
<tbody>
{{ rows(file) }}
</tbody></table></div>
</details>
{% endfor %}
{% endif %}
"""
_ROW_HTML = Markup('<tr><td class="no">{}</td>{}{}<td class="text"><code>{}</code></td></tr>\n')
_GAP_HTML = Markup('<tr class="gap"><td colspan="4">{}</td></tr>\n')
_EMPTY_CELL_HTML = Markup("<td></td>")
_MARK_HTML = Markup('<td class="mark {}"><a href="#{}" title="{}" aria-label="{}">{}</a></td>')
_TOKEN_HTML = Markup('<span class="py-{}">{}</span>')
_CSS_CLASS_BY_TOKEN = {tokenize.COMMENT: "comment", tokenize.NUMBER: "number", tokenize.STRING: "string"}


def build_source_panel(run: ReportedRun) -> Panel | None:
    """Return the panel with each file that has faults. Only the worst file is unfolded."""
    source = run.source_lines
    if source is None:
        return None
    worst = _worst_lines_table(source.files)
    parts = [
        "## Source",
        source.reason_without_files or _INTRODUCTION,
        *([worst.as_markdown()] if worst.rows else ()),
    ]
    html = rendered(
        _HTML_TEMPLATE,
        why=source.reason_without_files,
        about=_INTRODUCTION,
        signs=_ENDING_SIGNS,
        meanings=_ENDING_MEANINGS,
        files=source.files,
        lasting=PERMANENCE_VALUES,
        describe=_describe_file,
        rows=_rows_html,
    )
    return Panel(
        anchor="source", link="Source", markdown="\n\n".join(parts), html=html, style="report/source.css"
    )


def _describe_file(file: MarkedFile) -> str:
    endings = [
        f"{_ENDING_MEANINGS[name].partition(':')[0]} {n}" for name, n in file.line_counts_by_ending().items()
    ]
    return f"{counted(len(file.marks), 'line')} with mutants, by worst outcome: {', '.join(endings)}"


def _worst_lines_table(files: Sequence[MarkedFile]) -> TextTable:
    ranked_lines = [
        (min(ENDINGS_WORST_FIRST.index(mark.worst_ending) for mark in marks.values()), number, line, marks)
        for number, file in enumerate(files)
        for line, marks in file.marks.items()
    ]
    rows = [
        (
            f"{files[number].path}:{line}",
            f"`{files[number].lines[line - 1].strip()}`",
            *(_describe_mark(marks[name]) if name in marks else "-" for name in PERMANENCE_VALUES),
        )
        for _, number, line, marks in sorted(ranked_lines, key=lambda ranked: ranked[:3])[:_MOST_LISTED_LINES]
    ]
    return TextTable(heads=("line", "source (the worst lines)", *PERMANENCE_VALUES), rows=rows)


def _describe_mark(mark: LineMark) -> str:
    ending = _ENDING_MEANINGS[mark.worst_ending].partition(":")[0]
    return f"{ending} {mark.worst_mutant_count}/{mark.mutant_count}"


def _rows_html(file: MarkedFile) -> Markup:
    texts, rows, last = _coloured_lines(file), list[Markup](), 0
    for part in file.shown_lines:
        if gap := part.start - last - 1:
            rows.append(_GAP_HTML.format(f"{counted(gap, 'line')} without faults"))
        for line in part:
            rows.append(_row_html(file, line, texts[line - 1]))
        last = part.stop - 1
    return Markup("").join(rows)


def _row_html(file: MarkedFile, line: int, text: Markup) -> Markup:
    marks, place = file.marks.get(line, {}), f"{file.path}:{line}"
    cells = [
        _mark_html(marks[name], line, place, name) if name in marks else _EMPTY_CELL_HTML
        for name in PERMANENCE_VALUES
    ]
    number = Markup('<a href="#{}" title="list the experiments of line {}">{}</a>').format(
        _search_fragment(place), line, line
    )
    return _ROW_HTML.format(number if marks else line, *cells, text)


def _mark_html(mark: LineMark, line: int, place: str, lasting: str) -> Markup:
    share = f"{mark.worst_mutant_count}/{mark.mutant_count}"
    words = f"line {line}, {lasting}: {_ENDING_MEANINGS[mark.worst_ending]} for {mark.worst_mutant_count} of "
    words += counted(mark.mutant_count, "mutant")
    query = _search_fragment(place, f"lasting={lasting}")
    return _MARK_HTML.format(
        mark.worst_ending, query, words, words, f"{_ENDING_SIGNS[mark.worst_ending]} {share}"
    )


def _search_fragment(place: str, *more: str) -> str:
    """Return the URL fragment that searches the list of experiments (web/report/state.js)."""
    return f"q={quote(' '.join((f'line={place}', *more)), safe='')}"


def _coloured_lines(file: MarkedFile) -> list[Markup]:
    """Return the lines of a file as HTML, coloured as in diffs."""
    coloured, coloured_to = [Markup("")] * len(file.lines), [0] * len(file.lines)
    for line, start, end, name in _coloured_parts(file):
        text, begin = file.lines[line], max(start, coloured_to[line])
        coloured[line] += escape(text[coloured_to[line] : begin]) + _TOKEN_HTML.format(name, text[begin:end])
        coloured_to[line] = max(end, begin)
    return [
        html + escape(text[end:]) for html, text, end in zip(coloured, file.lines, coloured_to, strict=True)
    ]


def _coloured_parts(file: MarkedFile) -> Iterator[tuple[int, int, int, str]]:
    """Yield the coloured parts in source order: line (from 0), first and last column, and CSS class."""
    for token in tokenize.tokenize(io.BytesIO(file.data).readline):
        name = _CSS_CLASS_BY_TOKEN.get(token.type, "")
        if token.type == tokenize.NAME and keyword.iskeyword(token.string):
            name = "keyword"
        elif tokenize.tok_name[token.type].startswith(("FSTRING", "TSTRING")):
            name = "string"
        if not name:
            continue
        (first, start), (last, end) = token.start, token.end
        for line in range(first - 1, last):
            begin = start if line == first - 1 else 0
            stop = end if line == last - 1 else len(file.lines[line])
            if begin < stop:
                yield line, begin, stop, name
