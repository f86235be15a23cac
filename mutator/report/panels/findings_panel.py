"""The panel of a search for hazardous faults: its findings."""

from markupsafe import Markup

from mutator.figures.finding_curve import draw_finding_curve
from mutator.report.explored_planes import NO_PROBABILITY_NOTE
from mutator.report.panel import Panel, rendered
from mutator.report.reported_run import ReportedRun
from mutator.report.search_findings import FINDINGS_NOTE, SearchFindings, describe_random_searches

_HTML_TEMPLATE = """\
<h2>Findings</h2>
<p><b>{{ findings.sentence() }}</b></p>
{% if note %}
<p><b>{{ note }}.</b></p>
{% endif %}
<p class="quiet">{{ no_probability }}</p>
{% if findings.findings %}
{{ findings.table(with_links=True).as_html("plain") }}
<figure>{{ curve }}
<figcaption class="quiet">Distinct findings over runs. {{ beside | marked }}</figcaption></figure>
<p class="quiet">{{ about | marked }}</p>
{% endif %}
"""


def build_findings_panel(run: ReportedRun) -> Panel | None:
    """Return the panel; None for a run without a search."""
    findings = run.explored
    if not isinstance(findings, SearchFindings):
        return None
    note = findings.note[:1].upper() + findings.note[1:]
    parts = ["## Findings", findings.sentence(), f"**{note}.**" if note else "", NO_PROBABILITY_NOTE]
    beside = describe_random_searches(findings.counts, run.random_searches)
    if findings.findings:
        parts += [findings.table(with_links=False).as_markdown(), FINDINGS_NOTE, beside]
    html = rendered(
        _HTML_TEMPLATE,
        findings=findings,
        note=note,
        no_probability=NO_PROBABILITY_NOTE,
        about=FINDINGS_NOTE,
        beside=beside,
        curve=Markup(draw_finding_curve(findings.counts, [search.counts for search in run.random_searches])),
    )
    return Panel(
        anchor="findings",
        link="Findings",
        markdown="\n\n".join(filter(None, parts)),
        html=html,
        style="report/envelopes.css",
    )
