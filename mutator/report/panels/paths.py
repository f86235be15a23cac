"""How far faults got: the control structure with the share that got through each link, and the stops."""

from collections.abc import Mapping, Sequence

from mutator._common.tables import Table
from mutator.report.panel import Panel, rendered
from mutator.report.path_drawing import draw_ways, share_text
from mutator.report.paths import ALL, FoundPaths, PathCounts, counts_by_fault_type
from mutator.report.studies import ReportedRun
from mutator.stpa.analysis import LinkModel
from mutator.web import plainly_embedded

_ABOUT = (
    "Of the faults that were active: how many came to the start of each link of the control structure, and "
    "how many got through, so that what is recorded behind it left the golden run."
)
_HTML = """\
<h2>How far faults got</h2>
<p>{{ about }}</p>
{% if figure %}
<p class="quiet">The thicker a link, the more got through; it is dashed where none did, and thin where its
end is not recorded. Orange boxes: injected there; green ones: stopped there. Dotted: feedback and people, on
no path. A link filters the list to the experiments that got through it, a box to those stopped there.</p>
<div class="row"><label for="ways-kind">Faults:</label> <select id="ways-kind" disabled>
{% for kind in kinds %}
<option>{{ kind }}</option>
{% endfor %}
</select> <span class="quiet" id="ways-active" role="status">{{ counts[all].active }} active</span></div>
<div class="scroll" id="ways" tabindex="0" role="group" aria-label="Control structure">{{ figure }}</div>
{{ data }}
<details><summary>The same numbers as a table</summary>
<div class="scroll"><table id="ways-table"><thead><tr><th scope="col">from</th><th scope="col">to</th>
<th scope="col">what it carries</th><th scope="col">got through, of those that came</th></tr></thead><tbody>
{% for name, link in links.items() %}
<tr data-link="{{ name }}"><td>{{ label(link.from_) }}</td><td>{{ label(link.to) }}</td>
<td>{{ link.label }}</td>
<td class="number">{{ share(counts[all].through[name], counts[all].came[name]) }}</td></tr>
{% endfor %}
</tbody></table></div></details>
{% endif %}
<h3>Where faults were stopped</h3>
{{ stops.as_html("counts") }}
"""


def paths_panel(run: ReportedRun) -> Panel | None:
    """Links and components with their counts; None where no path is known."""
    paths = run.paths
    counts = counts_by_fault_type(run.rows, paths) if paths else {}
    if paths is None or not counts:
        return None
    links = _links(paths)
    structure = paths.ways.structure
    stops = _stops(counts, paths)
    parts = ["## How far faults got", _ABOUT]
    if links:
        parts.append(_table(links, counts[ALL], paths).as_markdown())
    parts += ["### Where faults were stopped", stops.as_markdown()]
    html = rendered(
        _HTML,
        about=_ABOUT,
        figure=_markup(draw_ways(structure, counts[ALL], links)) if structure else None,
        kinds=list(counts),
        all=ALL,
        counts=counts,
        data=_markup(plainly_embedded({kind: c.plain() for kind, c in counts.items()}, "ways-data")),
        links=links,
        label=paths.label,
        share=lambda through, came: share_text(through, came) or "none came",
        stops=stops,
    )
    return Panel(anchor="propagation", link="Paths", markdown="\n\n".join(parts), html=html)


def _links(paths: FoundPaths) -> Mapping[str, LinkModel]:
    """The links of the structure that some path has, in its order."""
    taken = {crossing.link for path in paths.by_id.values() for crossing in path.crossings}
    structure = paths.ways.structure
    return {name: link for name, link in structure.links.items() if name in taken} if structure else {}


def _table(links: Mapping[str, LinkModel], counts: PathCounts, paths: FoundPaths) -> Table:
    rows = [
        (paths.label(link.from_), paths.label(link.to), link.label, share_text(counts.through[name], came))
        for name, link in links.items()
        if (came := counts.came[name])
    ]
    return Table(heads=("from", "to", "what it carries", "got through, of those that came"), rows=rows)


def _stops(counts: Mapping[str, PathCounts], paths: FoundPaths) -> Table:
    """A line for each fault type, the total last; a column for each component that stopped a fault."""
    names = [name for name in paths.components if counts[ALL].stopped[name]]
    heads = ["fault type", "active", *(f"stopped at {paths.label(name)}" for name in names)]
    order = [*(kind for kind in counts if kind != ALL), ALL]
    rows: list[Sequence[str]] = [
        (kind, str(counts[kind].active), *(str(counts[kind].stopped[name]) for name in names))
        for kind in order
    ]
    return Table(heads=heads, rows=rows, right=range(1, len(heads)))


def _markup(text: str):  # type: ignore[no-untyped-def]  # markupsafe is imported where a page is made
    from markupsafe import Markup

    return Markup(text)
