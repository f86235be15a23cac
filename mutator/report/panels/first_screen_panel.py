"""The first part of a report: the worst experiment in words, with its replay, and four numbers."""

from mutator.report.answer_parts import warning_filter_values
from mutator.report.first_screen_facts import describe_change, key_numbers, worst_row
from mutator.report.panel import Panel, rendered
from mutator.report.reported_run import ReportedRun
from mutator.results.note_on_golden_hazards import golden_hazards_note
from mutator.results.note_without_canary import no_canary_note
from mutator.results.result_rows import ResultRow

_HTML_TEMPLATE = """\
<section class="first-screen" aria-label="The worst experiment{{ ", and four numbers" if numbers }}">
{% if no_canary %}
<p><b>{{ no_canary }}</b></p>
{% endif %}
{% if golden_hazards %}
<p><b>{{ golden_hazards | marked }}</b></p>
{% endif %}
{% if worst %}
<div class="worst">
<p class="kicker">{{ kicker }}</p>
<h2>{{ worst.sentence or worst.fault }}</h2>
<p class="under"><span class="ending {{ worst.ending }}">{{ worst.ending | replace("_", " ") }}</span>
<span class="fault">{{ worst.fault }}</span> in {{ worst.scenario_label }}, trigger {{ worst.trigger }}.
<a href="#e={{ worst.experiment_id }}">Open it: diff, plots, metrics</a></p>
<div id="worst-replay"></div>
</div>
{% endif %}
{% if numbers %}
<div class="key-numbers">
<ul>
{% for number in numbers %}
<li>
{% if number.fragment %}
<a href="#{{ number.fragment }}"><b>{{ number.value }}</b> {{ number.meaning }}</a>
{% else %}
<p><b>{{ number.value }}</b> {{ number.meaning }}</p>
{% endif %}
{% if number.percents %}
<span class="interval" style="--rate: {{ number.percents[0] }}; --low: {{ number.percents[1] }};
--high: {{ number.percents[2] }}"></span>
{% endif %}
<span class="quiet">{{ number.evidence }}</span>
</li>
{% endfor %}
</ul>
{% if note %}
<p class="quiet">{{ note }}</p>
{% endif %}
</div>
{% endif %}
{% if change %}
<div class="change">
<p><b>Since the run before:</b> {{ change.text }} {{ change.advice | marked }}</p>
{% if change.hazards %}
<ul>
{% for what, row in change.hazards %}
<li>{{ what }}: <a href="#e={{ row.experiment_id }}">{{ row.sentence or row.fault }}</a></li>
{% endfor %}
</ul>
{% endif %}
</div>
{% endif %}
</section>
"""


def build_first_screen_panel(run: ReportedRun) -> Panel:
    worst = worst_row(run)
    frame = run.frame.assign(warning=warning_filter_values(run.frame))
    # of runs that a search chose, shares say nothing
    numbers = () if run.explored else key_numbers(frame, has_alerts=run.folder.has_alerts)
    note = run.sampled_plan.note if run.sampled_plan else ""
    kicker = _words_before_worst_experiment(worst) if worst else ""
    change = describe_change(run)
    lines = [f"* **{number.value}** {number.meaning} ({number.evidence})" for number in numbers]
    no_canary = no_canary_note(run.folder, run.results)
    golden_hazards = golden_hazards_note(run.folder, run.results)
    parts = [
        f"**{no_canary}**" if no_canary else "",
        f"**{golden_hazards}**" if golden_hazards else "",
        _worst_markdown(kicker, worst) if worst else "",
        "\n".join(lines),
        note,
        change.markdown if change else "",
    ]
    html = rendered(
        _HTML_TEMPLATE,
        no_canary=no_canary,
        golden_hazards=golden_hazards,
        worst=worst,
        kicker=kicker,
        numbers=numbers,
        note=note,
        change=change,
    )
    return Panel(anchor="first", link="Summary", markdown="\n\n".join(filter(None, parts)), html=html)


def _words_before_worst_experiment(worst: ResultRow) -> str:
    return "The worst experiment" if worst.hazards else "No hazard occurred. The worst experiment"


def _worst_markdown(kicker: str, worst: ResultRow) -> str:
    place = f"{worst.fault} in {worst.scenario_label}, trigger {worst.trigger}, `{worst.experiment_id}`"
    return f"**{kicker}:** {worst.sentence} ({place})" if worst.sentence else f"**{kicker}:** {place}"
