"""Draws the control structure of a run, with the number of faults that passed each link or stopped in each
box. path_counts.js shows the counts of other faults in the drawing.
"""

from collections.abc import Collection, Iterator
from html import escape
from typing import Any
from urllib.parse import quote

from mutator._common.message_text import rounded_percent
from mutator.report.fault_path_page_data import PathCounts, link_name
from mutator.statistics.shares_with_intervals import share_with_interval
from mutator.stpa import arrow_and_box_svg
from mutator.stpa.arrow_and_box_svg import svg_path_data
from mutator.stpa.control_structure_layout import ComponentBox, LinkArrow, lay_out_structure
from mutator.stpa.hazard_analysis_yaml import ControlStructureModel, LinkModel

_WIDEST_LINE_PX = 7.0  # px, width of a link that passed all its faults
_THINNEST_LINE_PX = 1.8


def structure_with_paths(structure: ControlStructureModel, links: Collection[str]) -> ControlStructureModel:
    """Return the part of a control structure that faults can take by these `links`: their ends, and all links
    between them.
    """
    ends = {end for name in links if (link := structure.links.get(name)) for end in (link.from_, link.to)}
    return structure.model_copy(
        update={
            "components": {
                name: component for name, component in structure.components.items() if name in ends
            },
            "links": {n: link for n, link in structure.links.items() if {link.from_, link.to} <= ends},
        }
    )


def draw_path_counts(structure: ControlStructureModel, counts: PathCounts, links: Collection[str]) -> str:
    """Return the control structure as SVG. `links` are those that a fault can take."""
    plain = {n: c.model_copy(update={"process_model": {}}) for n, c in structure.components.items()}
    layout = lay_out_structure(structure.model_copy(update={"components": plain}), least_text_lines=2)
    size = f"{layout.width:.0f} {layout.height:.0f}"
    lines = [
        f'<svg class="path-figure" xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {size}" '
        f'width="{layout.width:.0f}" height="{layout.height:.0f}" role="group" '
        'aria-label="Control structure with the share of faults that got through each link">',
        "<defs>",
        *(
            arrow_and_box_svg.tip_marker(
                f"path-tip-{name}", 14, f'class="tip {name}" d="{arrow_and_box_svg.TIP_OUTLINE}"'
            )
            for name in ("quiet", "through", "stopped")
        ),
        "</defs>",
    ]
    for name, link in structure.links.items():
        if name not in links:
            lines += _idle_link_svg(layout.arrow_by_link[name], link)
    for name, link in structure.links.items():
        if name in links:
            lines += _link_svg(name, layout.arrow_by_link[name], link, counts)
    for name, component in plain.items():
        lines += _box_svg(name, layout.box_by_component[name], component.label, component.about, counts)
    return "\n".join((*lines, "</svg>"))


def counts_for_drawing(
    structure: ControlStructureModel, counts: PathCounts, links: Collection[str]
) -> dict[str, Any]:
    """Return what path_counts.js changes in the drawing to show other counts."""
    return {
        "active": counts.active_fault_count,
        "links": {name: _link_kind_width_count_and_interval(counts, name) for name in links},
        "components": {name: _box_classes_and_count_lines(name, counts) for name in structure.components},
    }


def describe_passed_share(counts: PathCounts, link: str) -> str:
    """For example `12 of 40, 30 %`, of a sample `12 of 40`; '' if no fault reached the link."""
    passed, reached = counts.passed_by_link[link], counts.reached_by_link[link]
    percent = "" if counts.is_sample or not reached else f", {rounded_percent(passed, reached)} %"
    return f"{passed} of {reached}{percent}" if reached else ""


def describe_interval(counts: PathCounts, link: str) -> str:
    """Return the 95 % interval of the share, or that there is none; '' if no fault reached the link."""
    passed, reached = counts.passed_by_link[link], counts.reached_by_link[link]
    if not reached:
        return ""
    if counts.is_sample:
        return "of those that ran"
    result = share_with_interval(passed, reached)
    return f"95 % interval {100 * result.low:.0f} to {100 * result.high:.0f} %"


def _is_short(arrow: LinkArrow) -> bool:
    """Whether the boxes are side by side, so that the count needs two lines."""
    return arrow.corners[0][1] == arrow.corners[-1][1]


def _idle_link_svg(arrow: LinkArrow, link: LinkModel) -> Iterator[str]:
    yield (
        f'<g class="idle"><path d="{svg_path_data(arrow.corners)}" stroke-dasharray="3 4" '
        f'marker-end="url(#path-tip-quiet)"/>{arrow_and_box_svg.label_line(arrow, escape(link.label))}</g>'
    )


def _link_svg(name: str, arrow: LinkArrow, link: LinkModel, counts: PathCounts) -> Iterator[str]:
    kind, width, count, interval = _link_kind_width_count_and_interval(counts, name)
    short = _is_short(arrow)
    first, _, last = count.partition(", ") if short else (count, "", "")
    yield (
        f'<a class="link is-{kind}" data-link="{escape(name)}"{" data-short" if short else ""} '
        f'href="#through={quote(link_name(link.from_, link.to))}">'
        f"<title>{escape(f'{link.label}: from {link.from_} to {link.to}')}\n{interval}</title>"
        f'<path class="hit" d="{svg_path_data(arrow.corners)}"/>'
        f'<path class="line" d="{svg_path_data(arrow.corners)}" '
        f'style="stroke-width: {width}" marker-end="url(#path-tip-{kind})"/>'
        f"{arrow_and_box_svg.label_line(arrow, escape(link.label))}"
        f"{arrow_and_box_svg.label_line(arrow, first, 1, 'count')}"
        f"{arrow_and_box_svg.label_line(arrow, last, 2, 'count')}</a>"
    )


def _link_kind_width_count_and_interval(counts: PathCounts, name: str) -> tuple[str, str, str, str]:
    """Return a link's kind, the width of its line, its count, and the interval of its share."""
    passed, reached = counts.passed_by_link[name], counts.reached_by_link[name]
    kind = "through" if passed else "stopped" if reached else "quiet"
    width = _THINNEST_LINE_PX + (_WIDEST_LINE_PX - _THINNEST_LINE_PX) * (passed / reached if reached else 0.0)
    count, interval = describe_passed_share(counts, name), describe_interval(counts, name)
    return kind, f"{width:.1f}px", count, interval


def _box_classes_and_count_lines(name: str, counts: PathCounts) -> tuple[str, str, str]:
    """Return a box's classes, and its two lines of counts. Where no fault was injected or stopped, the first
    line says how many came there.
    """
    faults = {"injected": counts.injected_by_component[name], "stopped": counts.stopped_by_component[name]}
    has = "".join(f" has-{what}" for what, n in faults.items() if n)
    first = ", ".join(f"{n} {what}" for what, n in faults.items() if n)
    masked = counts.masked_by_component[name]
    return (
        f"box{has}",
        first or f"{counts.entered_by_component[name]} came here",
        f"{masked} masked" if masked else "",
    )


def _box_svg(name: str, box: ComponentBox, label: str, about: str, counts: PathCounts) -> Iterator[str]:
    classes, first, last = _box_classes_and_count_lines(name, counts)
    middle, top = box.x + box.width / 2, box.y + box.height / 2
    yield (
        f'<a class="{classes}" data-component="{escape(name)}" href="#stopped_at={quote(name)}">'
        f"<title>{escape(about)}</title>"
        f"{arrow_and_box_svg.box_rectangle(box)}"
        f'<text class="name" x="{middle:.1f}" y="{top - 11:.1f}" text-anchor="middle">{escape(label)}</text>'
        f'<text class="count" x="{middle:.1f}" y="{top + 6:.1f}" text-anchor="middle">{first}</text>'
        f'<text class="count" x="{middle:.1f}" y="{top + 23:.1f}" text-anchor="middle">{last}</text></a>'
    )
