"""The panel of an exploration: what is survived, and a picture of each plane."""

from markupsafe import Markup

from mutator._common.message_text import counted
from mutator.explore.envelope_texts import describe_envelope, name_of_plane
from mutator.figures.plane_drawing import draw_plane
from mutator.report.explored_planes import (
    NO_PROBABILITY_NOTE,
    TABLE_NOTE,
    ExploredPlanes,
)
from mutator.report.panel import Panel, rendered
from mutator.report.plane_sentences import describe_plane_validation
from mutator.report.reported_run import ReportedRun

_MOST_OPEN_PICTURES = 12
_HTML_TEMPLATE = """\
<h2>What is survived</h2>
<p class="survived-sentence">{{ planes.first_sentence() }}</p>
{% if planes.describe_all() %}
<p>{{ planes.describe_all() }}</p>
{% endif %}
{% if note %}
<p><b>{{ note }}.</b></p>
{% endif %}
<p class="quiet">{{ planes.describe_scope() }} {{ no_probability }}</p>
{% if pictures %}
{{ table.as_html("plain envelopes") }}
<p class="quiet">{{ table_note }}</p>
{% if challenges.rows %}
<h3>What challengers lowered</h3>
{{ challenges.as_html("plain envelopes") }}
{% endif %}
<ul class="plane-legend">
<li><i class="dot survived"></i>run without a hazard</li>
<li><i class="dot failed"></i>run with a hazard</li>
<li><i class="dot open"></i>run that decides nothing</li>
<li><i class="cross">×</i>run without a hazard, whose controller ended disengaged or crashed</li>
<li><i class="shade survived"></i>without hazard</li>
<li><i class="shade failed"></i>hazardous</li>
<li><i class="shade inferred"></i>inferred: a shorter fault reached its hazard while it was active</li>
<li><i class="shade open"></i>not decided</li>
<li><i class="shade island"></i>island: hazardous, apart from the largest group</li>
</ul>
<div class="planes">
{% for name, text, picture in pictures[:most_open] %}
<figure>{{ picture }}<figcaption><b>{{ name }}</b> {{ text }}</figcaption></figure>
{% endfor %}
</div>
{% if pictures | length > most_open %}
<details>
<summary>{{ more }}</summary>
<div class="planes">
{% for name, text, picture in pictures[most_open:] %}
<figure>{{ picture }}<figcaption><b>{{ name }}</b> {{ text }}</figcaption></figure>
{% endfor %}
</div>
</details>
{% endif %}
{% endif %}
"""


def build_envelopes_panel(run: ReportedRun) -> Panel | None:
    """Return the panel; None for a run without an exploration."""
    return panel_of_planes(run.explored) if isinstance(run.explored, ExploredPlanes) else None


def panel_of_planes(planes: ExploredPlanes) -> Panel:
    note = planes.note[:1].upper() + planes.note[1:]
    parts = [
        "## What is survived",
        f"{planes.first_sentence()} {planes.describe_all()}".rstrip(),
        f"**{note}.**" if note else "",
        f"{planes.describe_scope()} {NO_PROBABILITY_NOTE}".lstrip(),
    ]
    if planes.envelopes:
        parts += [planes.table(with_links=False).as_markdown(), TABLE_NOTE]
        if (challenges := planes.challenges_table(with_links=False)).rows:
            parts += ["### What challengers lowered", challenges.as_markdown()]
        parts.append("A picture of each plane is in `index.html`.")
    pictures = [
        (
            name_of_plane(envelope),
            f"{describe_plane_validation(envelope)} {counted(envelope.run_count, 'run')}.",
            Markup(draw_plane(envelope, describe_envelope(envelope))),
        )
        for envelope in planes.envelopes
    ]
    html = rendered(
        _HTML_TEMPLATE,
        planes=planes,
        note=note,
        no_probability=NO_PROBABILITY_NOTE,
        table=planes.table(with_links=True),
        table_note=TABLE_NOTE,
        challenges=planes.challenges_table(with_links=True),
        pictures=pictures,
        most_open=_MOST_OPEN_PICTURES,
        more=f"{counted(max(0, len(pictures) - _MOST_OPEN_PICTURES), 'more plane')}",
    )
    return Panel(
        anchor="survived",
        link="What is survived",
        markdown="\n\n".join(filter(None, parts)),
        html=html,
        style="report/envelopes.css",
    )
