"""The panel of fault paths: what passed each link, and where faults stopped."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from markupsafe import Markup

from mutator._common.table_rendering import TextTable
from mutator.report.fault_path_drawing import (
    counts_for_drawing,
    describe_interval,
    describe_passed_share,
    draw_path_counts,
    structure_with_paths,
)
from mutator.report.fault_path_page_data import (
    ALL_FAULT_TYPES,
    PathCounts,
    RunFaultPaths,
    path_counts_by_fault_type,
)
from mutator.report.panel import Panel, rendered
from mutator.report.reported_run import ReportedRun
from mutator.results.outcome_counting import fault_types_of
from mutator.stpa.hazard_analysis_yaml import ControlStructureModel
from mutator.web import json_script_element

_INTRODUCTION = (
    "Each link shows how many active faults reached it and how many got through it. A fault got through if "
    "recorded signals behind the link differ from the golden run."
)
_NONE_STOPPED = "None: every active fault changed an actuator."
_HTML_TEMPLATE = """\
<h2>Fault paths</h2>
<p>{{ about }}</p>
{% if drawing %}
<p class="quiet">Links: the thicker, the more faults got through; dashed if none did; thin if the end is not
recorded; dotted if it belongs to no path, such as feedback. Boxes: orange if
faults were <strong>injected</strong> here; green if faults were <strong>stopped</strong> here, so they got
no further through this component. A fault that two components stopped is counted at both. A
<strong>masked</strong> fault changed no actuator at all. Select a link to list the experiments whose faults
got through it, or a box to list those whose faults were masked there.</p>
<div class="row"><label for="path-counts-kind">Faults:</label> <select id="path-counts-kind" disabled>
{% for kind in kinds %}
<option>{{ kind }}</option>
{% endfor %}
</select>
<span class="quiet" id="path-counts-active"
role="status">{{ counts[all].active_fault_count }} active</span></div>
<div class="scroll" id="path-counts" tabindex="0" role="group"
aria-label="Control structure">{{ drawing.figure }}</div>
{% if drawing.omitted %}
<p class="quiet">Not drawn, because no path leads there: {{ drawing.omitted }}.</p>
{% endif %}
{{ drawing.data }}
{% endif %}
<details{{ "" if drawing else " open" }}>
<summary>{{ "The same numbers as a table" if drawing else "Links" }}</summary>
<div class="scroll"><table id="path-counts-table"><thead><tr><th scope="col">from</th><th scope="col">to</th>
<th scope="col">what it carries</th><th scope="col">got through, of those that reached it</th></tr></thead>
<tbody>
{% for name, (tail, tip, carries) in links.items() %}
<tr data-link="{{ name }}"><td>{{ label(tail) }}</td><td>{{ label(tip) }}</td>
<td>{{ carries }}</td>
<td class="number">{{ share(counts[all], name) }}</td></tr>
{% endfor %}
</tbody></table></div></details>
{% if other_entries %}
<p>{{ other_entries }}</p>
{% endif %}
<h3>Where masked faults were stopped</h3>
<p class="quiet">Each fault that changed no actuator is counted once, in the column that
names all components that stopped it.</p>
{% if stops %}
{{ stops.as_html("counts") }}
{% else %}
<p>{{ none_stopped }}</p>
{% endif %}
"""


LinkPartsByName = Mapping[str, tuple[str, str, str]]  # tail, tip, and what the link carries


def build_fault_paths_panel(run: ReportedRun) -> Panel | None:
    """Return the panel with the counts of links and components; None if no path is known."""
    paths = run.run_fault_paths
    counts = (
        path_counts_by_fault_type(
            fault_types_of(run.results),
            run.experiment_facts.untimed_path_indices,
            paths,
            is_sample=run.sampled_plan is not None,
        )
        if paths
        else {}
    )
    if paths is None or not counts:
        return None
    links = _links_in_order(paths)
    structure = paths.fault_paths.structure
    stops = _masked_faults_table(counts, paths)
    other_entries = _describe_other_entries(counts[ALL_FAULT_TYPES], paths)
    parts = [
        "## Fault paths",
        _INTRODUCTION,
        _links_table(links, counts[ALL_FAULT_TYPES], paths).as_markdown(),
        *([other_entries] if other_entries else []),
    ]
    parts += ["### Where masked faults were stopped", stops.as_markdown() if stops else _NONE_STOPPED]
    html = rendered(
        _HTML_TEMPLATE,
        about=_INTRODUCTION,
        drawing=_draw_path_counts(structure, counts, links) if structure else None,
        kinds=list(counts),
        all=ALL_FAULT_TYPES,
        counts=counts,
        links=links,
        label=paths.component_label,
        share=_describe_share_with_interval,
        other_entries=other_entries,
        stops=stops,
        none_stopped=_NONE_STOPPED,
    )
    return Panel(anchor="fault-paths", link="Fault paths", markdown="\n\n".join(parts), html=html)


class _Drawing(NamedTuple):
    figure: Markup
    data: Markup  # script element with the counts of each fault type
    omitted: str  # components that no path leads to


def _draw_path_counts(
    structure: ControlStructureModel, counts: Mapping[str, PathCounts], links: LinkPartsByName
) -> _Drawing:
    drawn = structure_with_paths(structure, links)
    count_texts = {kind: counts_for_drawing(drawn, of_kind, links) for kind, of_kind in counts.items()}
    omitted = [c.label for name, c in structure.components.items() if name not in drawn.components]
    return _Drawing(
        figure=Markup(draw_path_counts(drawn, counts[ALL_FAULT_TYPES], links)),
        data=Markup(json_script_element(count_texts, "path-counts-data")),
        omitted=", ".join(omitted),
    )


def _describe_share_with_interval(counts: PathCounts, link: str) -> str:
    """`12 of 40, 30 %; 95 % interval 18 to 45 %`, as path_counts.js joins it."""
    if not counts.reached_by_link[link]:
        return "none reached it"
    return f"{describe_passed_share(counts, link)}; {describe_interval(counts, link)}"


def _links_in_order(paths: RunFaultPaths) -> LinkPartsByName:
    """Return the links that occur in any path, in the order of the control structure."""
    links = {c.name: c for untimed_path in paths.distinct_untimed_paths for c in untimed_path.links}
    structure = paths.fault_paths.structure
    structure_links = structure.links if structure else {}
    order = [
        *(name for name in structure_links if name in links),
        *(name for name in links if name not in structure_links),
    ]
    return {
        name: (
            links[name].tail,
            links[name].tip,
            structure_links[name].label if name in structure_links else "",
        )
        for name in order
    }


def _links_table(links: LinkPartsByName, counts: PathCounts, paths: RunFaultPaths) -> TextTable:
    rows = [
        (
            paths.component_label(tail),
            paths.component_label(tip),
            carries,
            _describe_share_with_interval(counts, name),
        )
        for name, (tail, tip, carries) in links.items()
        if counts.reached_by_link[name]
    ]
    return TextTable(
        heads=("from", "to", "what it carries", "got through, of those that reached it"), rows=rows
    )


def _describe_other_entries(counts: PathCounts, paths: RunFaultPaths) -> str:
    """Return how many faults changed a component without getting through any of the links to it; '' if none
    did. A controller that disengages because a signal is lost is an example.
    """
    structure = paths.fault_paths.structure
    links = list(structure.links.values()) if structure else []
    sentences = []
    for name, label in ((name, paths.component_label(name)) for name in paths.components):
        count = counts.entered_otherwise_by_component[name]
        if not count or name in paths.fault_paths.process_components:
            continue
        carried = [f"“{link.label}”" for link in links if link.to == name and not link.studied]
        sentences.append(
            f"{count:,} of {counts.active_fault_count:,} active faults changed {label} before the process, "
            "but got through none of these links to it."
        )
        if carried:
            sentences.append(f"Links to {label} that are not studied carry {' and '.join(carried)}.")
    return " ".join(sentences)


def _masked_faults_table(counts: Mapping[str, PathCounts], paths: RunFaultPaths) -> TextTable | None:
    """Return the table of masked faults by fault type, with a column for each set of components that stopped
    them. None if no fault was masked.
    """
    ends = sorted(
        counts[ALL_FAULT_TYPES].masked_by_component_set,
        key=lambda names: (len(names), list(map(paths.component_label, names))),
    )
    if not ends:
        return None
    heads = [
        "fault type",
        "active",
        "masked",
        *(" and ".join(map(paths.component_label, names)) for names in ends),
    ]
    order = [*(kind for kind in counts if kind != ALL_FAULT_TYPES), ALL_FAULT_TYPES]
    rows: list[Sequence[str]] = [
        (
            kind,
            *map(str, (counts[kind].active_fault_count, counts[kind].masked_by_component_set.total())),
            *(str(counts[kind].masked_by_component_set[names]) for names in ends),
        )
        for kind in order
    ]
    return TextTable(heads=heads, rows=rows, right_aligned=range(1, len(heads)))
