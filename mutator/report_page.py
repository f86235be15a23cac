"""The two forms of a report: Markdown for reading anywhere, one HTML page without outside help."""

from typing import TYPE_CHECKING

from mutator.tables import Row

if TYPE_CHECKING:
    from mutator.report import Content

LISTED = 30  # failed runs that the Markdown lists; the page lists all

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
        parts += [f"## {table.title}", markdown_table(table.heads, table.lines)]
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
        parts.append(markdown_table(content.engine.heads, content.engine.lines))
    parts += [
        "## Where this comes from",
        markdown_table(["what", "value"], [list(f) for f in content.facts]),
    ]
    parts.append("The table of all experiments is `results.csv`; `index.html` lists them with their diffs.")
    return "\n\n".join(parts) + "\n"


def _outcome_text(content: "Content") -> str:
    total = sum(content.outcomes.values())
    return f"{total} experiments: " + ", ".join(f"{n} {name}" for name, n in content.outcomes.items()) + "."


def _failed_text(content: "Content") -> str:
    lines = [
        [r.status.value, r.experiment_id, r.fault, r.scenario, r.detail] for r in content.failed[:LISTED]
    ]
    table = markdown_table(["status", "experiment", "fault", "scenario", "what was said"], lines)
    more = len(content.failed) - LISTED
    return f"{table}\n\n{more} more are in `results.csv`." if more > 0 else table


def markdown_table(heads: list[str], lines: list[list[str]]) -> str:
    """A table of texts in Markdown, whatever is in them."""

    def row(cells: list[str]) -> str:
        return "| " + " | ".join(c.replace("|", "\\|").replace("\n", " ") for c in cells) + " |"

    rule = "| " + " | ".join("---" for _ in heads) + " |"
    return "\n".join([row(heads), rule, *(row(line) for line in lines)])


def page(content: "Content") -> str:
    """The report as one HTML page; every text in it is escaped."""
    from jinja2 import Environment, StrictUndefined

    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters["seconds"] = _seconds
    template = environment.from_string(PAGE)
    return template.render(content=content, notes=NOTES.replace("*", ""), hazards=_hazards)


def _seconds(value: float | None) -> str:
    return "" if value is None else f"{value:.2f}"


def _hazards(row: Row) -> str:
    return ", ".join(f"{name} {t:.2f}" for name, t in row.hazards)


PAGE = """\
<!doctype html>
<html lang="en">
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{{ content.name }} - fault injection report</title>
<style>
:root { color-scheme: light dark; --line: #8886; --shade: #8881; }
body { font: 15px/1.45 system-ui, sans-serif; margin: 1.5rem auto; max-width: 78rem; padding: 0 1rem; }
h1, h2, h3 { line-height: 1.2; }
img { max-width: 100%; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
th, td { padding: .2rem .6rem; border-bottom: 1px solid var(--line); text-align: left; vertical-align: top; }
th { background: var(--shade); }
.counts td:not(:first-child), .counts th:not(:first-child), .number { text-align: right; }
.counts tr:last-child td { font-weight: 600; border-top: 2px solid var(--line); }
.hazard { color: #c62828; font-weight: 600; }
.harness_error, .invalid_mutant { background: #c62828; color: #fff; }
.crashed, .timeout { color: #8e24aa; font-weight: 600; }
.verdict { border: 1px solid var(--line); border-radius: 1rem; font-size: .75em; padding: .1rem .6rem; }
.group td { color: #888; border-bottom-style: dotted; }
pre { overflow-x: auto; background: var(--shade); padding: .6rem; font-size: .85em; }
code { font-size: .9em; }
.chips span { display: inline-block; margin: 0 .5rem .3rem 0; padding: .1rem .6rem;
  border: 1px solid var(--line); border-radius: 1rem; }
@media print { body { max-width: none; font-size: 10pt; } }
</style>
<h1>{{ content.name }}</h1>
{% if content.engine and content.engine.failed %}
<p class="hazard">{{ content.engine.proof }}</p>
{% endif %}
<p class="chips">{% for name, n in content.outcomes.items() %}
<span class="{{ name }}">{{ n }} {{ name }}</span>
{% endfor %}</p>
<p>{{ content.planned }}</p>
{% if content.observations %}
<h2>The paper's observations</h2>
<p>{{ content.observations.coverage }}</p>
{% for one in content.observations.observations %}
<h3>{{ one.number }}. {{ one.title }} <span class="verdict">{{ one.verdict.value }}</span></h3>
<div class="scroll"><table>
<tr>{% for head in content.observations.heads %}<th>{{ head }}</th>{% endfor %}</tr>
{% for line in content.observations.lines(one) %}
<tr{% if not line[0] %} class="group"{% endif %}>{% for cell in line %}<td>{{ cell }}</td>{% endfor %}</tr>
{% endfor %}
</table></div>
<details><summary>Queries</summary>
<pre>{{ content.observations.session }}

{% for claim in one.claims %}
# {{ claim.number }} {{ claim.claim.says }}
{% for answer in claim.answers %}
{{ answer.query }}
{% else %}
# {{ claim.why }}
{% endfor %}
{% endfor %}
</pre></details>
{% endfor %}
<p>{{ content.observations.rules }}</p>
{% endif %}
<p>{{ notes }}</p>
{% for table in content.tables %}
<h2>{{ table.title }}</h2>
<div class="scroll"><table class="counts">
<tr>{% for head in table.heads %}<th>{{ head }}</th>{% endfor %}</tr>
{% for line in table.lines %}
<tr>{% for cell in line %}<td>{{ cell }}</td>{% endfor %}</tr>
{% endfor %}
</table></div>
{% endfor %}
{% for sheet in content.statistics %}
<h2>{{ sheet.title }}</h2>
<p>{{ sheet.note }}</p>
<div class="scroll"><table>
<tr>{% for head in sheet.heads %}<th>{{ head }}</th>{% endfor %}</tr>
{% for line in sheet.texts() %}
<tr>{% for cell in line %}<td>{{ cell }}</td>{% endfor %}</tr>
{% endfor %}
</table></div>
{% endfor %}
{% if content.figures %}
<h2>Figures</h2>
{% for drawing in content.figures %}
<h3>{{ drawing.title }}</h3>
<p>{{ drawing.note }}
{% for what, code in drawing.codes %}
<br>{{ what }}: <code>{{ code }}</code>
{% endfor %}</p>
{% if drawing.figure %}
<a href="{{ drawing.link("png") }}"><img src="{{ drawing.link("svg") }}" alt="{{ drawing.title }}"></a>
{% endif %}
{% endfor %}
{% endif %}
{% if content.failed %}
<h2>Runs that did not end well</h2>
<div class="scroll"><table>
<tr><th>status</th><th>experiment</th><th>fault</th><th>scenario</th><th>what was said</th></tr>
{% for row in content.failed %}
<tr><td class="{{ row.status.value }}">{{ row.status.value }}</td>
<td><code>{{ row.experiment_id }}</code></td>
<td>{{ row.fault }}</td><td>{{ row.scenario }}</td><td>{{ row.detail }}</td></tr>
{% endfor %}
</table></div>
{% endif %}
<h2>Experiments</h2>
<p>Times are seconds of simulation. A plot is made by <code>mutator show EXPERIMENT</code>, a picture
by its option <code>--still</code>.</p>
<div class="scroll"><table>
<tr><th>experiment</th><th>fault</th><th>scenario</th><th>method</th><th>trigger</th><th>outcome</th>
<th>activated</th><th>manifested</th><th>hazards</th><th>alerts</th><th>first alert</th><th>reaction</th>
<th>see</th></tr>
{% for line in content.experiments %}
{% set row = line.row %}
{% set ending = row.ending %}
<tr id="{{ row.experiment_id }}"><td><code>{{ row.experiment_id }}</code></td><td>{{ row.fault }}</td>
<td>{{ row.scenario }}</td><td>{{ row.method }}</td><td>{{ row.trigger }}</td>
<td class="{{ ending }}">{{ ending }}</td>
<td class="number">{{ row.t_activation | seconds }}</td><td class="number">{{ row.t_manifest | seconds }}</td>
<td>{{ hazards(row) }}</td><td>{{ row.alerts | join(", ") }}</td>
<td class="number">{{ row.t_alert | seconds }}</td><td class="number">{{ row.reaction_time | seconds }}</td>
<td>{% if line.patch %}<a href="{{ line.patch }}">diff</a>{% endif %}
{% if line.plot %}<a href="{{ line.plot }}">plot</a>{% endif %}
{% for time, link in line.stills %}<a href="{{ link }}">{{ time }}</a>
{% endfor %}</td></tr>
{% endfor %}
</table></div>
{% if content.engine %}
<h2>How the experiments were run</h2>
<p>{{ content.engine.proof }}</p>
<div class="scroll"><table>
<tr>{% for head in content.engine.heads %}<th>{{ head }}</th>{% endfor %}</tr>
{% for way, count in content.engine.lines %}
<tr><td>{{ way }}</td><td class="number">{{ count }}</td></tr>
{% endfor %}
</table></div>
{% endif %}
<h2>Where this comes from</h2>
<div class="scroll"><table>
{% for name, value in content.facts %}
<tr><td>{{ name }}</td><td>{{ value }}</td></tr>
{% endfor %}
</table></div>
</html>
"""
