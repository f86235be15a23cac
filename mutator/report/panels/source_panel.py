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
from mutator.report.source_lines import ENDINGS, LASTING, Mark, MarkedFile

_SIGNS = dict(zip(ENDINGS, "HCTAMN", strict=True))  # sign shown with a mark's colour
_MEANINGS = dict(
    zip(
        ENDINGS,
        ("hazard", "crash", "timeout", "actuator changed", "masked: no actuator changed", "not activated"),
        strict=True,
    )
)
_LISTED = 20  # maximum number of lines listed in Markdown
_ABOUT = (
    "Functions with injected faults. Each line shows the worst outcome of its permanent mutants and, next to "
    "it, of its transient ones, with the number of mutants that had it. A mutant is counted by its worst "
    "experiment; harness errors are not counted."
)
_HTML = """\
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
<summary><h3><code>{{ file.path }}</code></h3> <span class="quiet">{{ told(file) }}</span></summary>
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
_ROW = Markup('<tr><td class="no">{}</td>{}{}<td class="text"><code>{}</code></td></tr>\n')
_GAP = Markup('<tr class="gap"><td colspan="4">{}</td></tr>\n')
_EMPTY = Markup("<td></td>")
_MARK = Markup('<td class="mark {}"><a href="#{}" title="{}" aria-label="{}">{}</a></td>')
_PART = Markup('<span class="py-{}">{}</span>')
_CLASSES = {tokenize.COMMENT: "comment", tokenize.NUMBER: "number", tokenize.STRING: "string"}


def build_source_panel(run: ReportedRun) -> Panel | None:
    """Return the panel with each file that has faults. Only the worst file is unfolded."""
    source = run.source
    if source is None:
        return None
    worst = _worst(source.files)
    parts = ["## Source", source.why or _ABOUT, *([worst.as_markdown()] if worst.rows else ())]
    html = rendered(
        _HTML,
        why=source.why,
        about=_ABOUT,
        signs=_SIGNS,
        meanings=_MEANINGS,
        files=source.files,
        lasting=LASTING,
        told=_told,
        rows=_rows,
    )
    return Panel(
        anchor="source", link="Source", markdown="\n\n".join(parts), html=html, style="report/source.css"
    )


def _told(file: MarkedFile) -> str:
    endings = [f"{_MEANINGS[name].partition(':')[0]} {n}" for name, n in file.worst_lines().items()]
    return f"{counted(len(file.marks), 'line')} with mutants, by worst outcome: {', '.join(endings)}"


def _worst(files: Sequence[MarkedFile]) -> TextTable:
    found = [
        (min(ENDINGS.index(mark.ending) for mark in here.values()), number, line, here)
        for number, file in enumerate(files)
        for line, here in file.marks.items()
    ]
    rows = [
        (
            f"{files[number].path}:{line}",
            f"`{files[number].lines[line - 1].strip()}`",
            *(_words(here[name]) if name in here else "-" for name in LASTING),
        )
        for _, number, line, here in sorted(found, key=lambda one: one[:3])[:_LISTED]
    ]
    return TextTable(heads=("line", "source (the worst lines)", *LASTING), rows=rows)


def _words(mark: Mark) -> str:
    return f"{_MEANINGS[mark.ending].partition(':')[0]} {mark.worst}/{mark.mutants}"


def _rows(file: MarkedFile) -> Markup:
    texts, rows, last = _coloured(file), list[Markup](), 0
    for part in file.shown:
        if left := part.start - last - 1:
            rows.append(_GAP.format(f"{counted(left, 'line')} without faults"))
        for line in part:
            rows.append(_row(file, line, texts[line - 1]))
        last = part.stop - 1
    return Markup("").join(rows)


def _row(file: MarkedFile, line: int, text: Markup) -> Markup:
    here, place = file.marks.get(line, {}), f"{file.path}:{line}"
    cells = [_mark(here[name], line, place, name) if name in here else _EMPTY for name in LASTING]
    number = Markup('<a href="#{}" title="list the experiments of line {}">{}</a>').format(
        _query(place), line, line
    )
    return _ROW.format(number if here else line, *cells, text)


def _mark(mark: Mark, line: int, place: str, lasting: str) -> Markup:
    share = f"{mark.worst}/{mark.mutants}"
    words = f"line {line}, {lasting}: {_MEANINGS[mark.ending]} for {mark.worst} of "
    words += counted(mark.mutants, "mutant")
    query = _query(place, f"lasting={lasting}")
    return _MARK.format(mark.ending, query, words, words, f"{_SIGNS[mark.ending]} {share}")


def _query(place: str, *more: str) -> str:
    """Return the URL fragment that searches the list of experiments (web/report/state.js)."""
    return f"q={quote(' '.join((f'line={place}', *more)), safe='')}"


def _coloured(file: MarkedFile) -> list[Markup]:
    """Return the lines of a file as HTML, coloured as in diffs."""
    made, done = [Markup("")] * len(file.lines), [0] * len(file.lines)
    for line, start, end, name in _parts(file):
        text, begin = file.lines[line], max(start, done[line])
        made[line] += escape(text[done[line] : begin]) + _PART.format(name, text[begin:end])
        done[line] = max(end, begin)
    return [html + escape(text[end:]) for html, text, end in zip(made, file.lines, done, strict=True)]


def _parts(file: MarkedFile) -> Iterator[tuple[int, int, int, str]]:
    """Yield the coloured parts in source order: line (from 0), first and last column, and CSS class."""
    for token in tokenize.tokenize(io.BytesIO(file.data).readline):
        name = _CLASSES.get(token.type, "")
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
