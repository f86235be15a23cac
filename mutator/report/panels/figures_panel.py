"""The panel of a run's figures. They are also files, and both forms of the report show them."""

import base64

from mutator.figures.drawings import Drawing, draw_figures, drawing_files
from mutator.figures.figure_style import with_page_theme
from mutator.report.panel import Panel, rendered
from mutator.report.reported_run import ReportedRun

_HTML_TEMPLATE = """\
<h2>Figures</h2>
{% for drawing in drawings %}
<h3>{{ drawing.title }}</h3>
<p>{{ drawing.note }}
{% for what, code in drawing.described_code_lines %}
<br>{{ what }}: <code>{{ code }}</code>
{% endfor %}</p>
{% if drawing.figure %}
<figure class="drawing"><img src="{{ picture(drawing) }}" alt="{{ drawing.title }}" decoding="async"></figure>
{% endif %}
{% endfor %}
"""


def build_figures_panel(run: ReportedRun) -> Panel | None:
    """Return the panel of figures over all results; None if there are none."""
    return _build_panel(draw_figures(run.frame))


def build_study_figures_panel(run: ReportedRun) -> Panel | None:
    """Return the panel of figures that the run's study adds; None if there are none."""
    return _build_panel(run.published_work.drawings(run)) if run.published_work else None


def _build_panel(drawings: tuple[Drawing, ...]) -> Panel | None:
    if not drawings:
        return None
    files = drawing_files(drawings)
    parts = ["## Figures"]
    for drawing in drawings:
        parts += [f"### {drawing.title}", drawing.note]
        parts += [f"{what}: `{code}`" for what, code in drawing.described_code_lines]
        if drawing.figure is not None:
            parts.append(f"![{drawing.title}]({drawing.file_name('svg')})")
    html = rendered(
        _HTML_TEMPLATE, drawings=drawings, picture=lambda drawing: _data_uri(files[drawing.file_name("svg")])
    )
    return Panel(anchor="figures", link="Figures", markdown="\n\n".join(parts), html=html, files=files)


def _data_uri(image: bytes) -> str:
    svg = with_page_theme(image.decode())
    return f"data:image/svg+xml;base64,{base64.b64encode(svg.encode()).decode()}"
