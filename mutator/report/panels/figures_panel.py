"""The panel of a run's figures. They are also files, and both forms of the report show them."""

import base64

from mutator.figures.drawings import Drawing, draw_figures, drawing_files
from mutator.figures.style import themed
from mutator.report.panel import Panel, rendered
from mutator.report.reported_run import ReportedRun

_HTML = """\
<h2>Figures</h2>
{% for drawing in drawings %}
<h3>{{ drawing.title }}</h3>
<p>{{ drawing.note }}
{% for what, code in drawing.codes %}
<br>{{ what }}: <code>{{ code }}</code>
{% endfor %}</p>
{% if drawing.figure %}
<figure class="drawing"><img src="{{ picture(drawing) }}" alt="{{ drawing.title }}" decoding="async"></figure>
{% endif %}
{% endfor %}
"""


def build_figures_panel(run: ReportedRun) -> Panel | None:
    """Return the panel of figures over all results; None if there are none."""
    return _panel(draw_figures(run.frame))


def build_study_figures_panel(run: ReportedRun) -> Panel | None:
    """Return the panel of figures that the run's study adds; None if there are none."""
    return _panel(run.study.drawings(run)) if run.study else None


def _panel(made: tuple[Drawing, ...]) -> Panel | None:
    if not made:
        return None
    files = drawing_files(made)
    parts = ["## Figures"]
    for drawing in made:
        parts += [f"### {drawing.title}", drawing.note]
        parts += [f"{what}: `{code}`" for what, code in drawing.codes]
        if drawing.figure is not None:
            parts.append(f"![{drawing.title}]({drawing.link('svg')})")
    html = rendered(_HTML, drawings=made, picture=lambda drawing: _embedded(files[drawing.link("svg")]))
    return Panel(anchor="figures", link="Figures", markdown="\n\n".join(parts), html=html, files=files)


def _embedded(image: bytes) -> str:
    svg = themed(image.decode())
    return f"data:image/svg+xml;base64,{base64.b64encode(svg.encode()).decode()}"
