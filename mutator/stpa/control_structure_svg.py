"""Draw the control structure as SVG and highlight where faults are injected."""

from collections.abc import Iterable, Iterator
from html import escape

from mutator.stpa import arrow_and_box_svg
from mutator.stpa.arrow_label_placement import Point
from mutator.stpa.control_structure_layout import (
    DRAWING_EDGE,
    ComponentBox,
    StructureLayout,
    lay_out_structure,
)
from mutator.stpa.hazard_analysis_yaml import ComponentKind, HazardAnalysis

FILL_BY_COMPONENT_KIND = {
    ComponentKind.HUMAN: "#ececec",
    ComponentKind.CONTROLLER: "#dbe9f6",
    ComponentKind.ESTIMATOR: "#e3f1ea",
    ComponentKind.ACTUATOR: "#fbeed5",
    ComponentKind.SENSOR: "#e8e4f3",
    ComponentKind.PROCESS: "#f3f3f3",
}
INK_COLOUR = "#222222"
# Okabe and Ito's palette, for colour-blind readers; dashes and width carry the same information.
ACTION_COLOUR, FEEDBACK_COLOUR, FAULT_COLOUR = "#0072b2", "#555555", "#d55e00"
LEGEND_HEIGHT = 54  # height of the key at the bottom, in px
STYLE_SHEET = (
    "text{font-family:Helvetica,Arial,sans-serif;font-size:13px;fill:#222222}"
    ".name{font-weight:bold;font-size:14px}"
    ".label{paint-order:stroke;stroke:#ffffff;stroke-width:4px;stroke-linejoin:round}"
    ".factor{font-size:11px;font-weight:bold;fill:#d55e00}"
)


def render_structure(analysis: HazardAnalysis) -> str:
    """Return the SVG text, which is deterministic."""
    layout = lay_out_structure(analysis.structure)
    height = layout.height + LEGEND_HEIGHT
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {layout.width:.0f} {height:.0f}" '
        f'width="{layout.width:.0f}" height="{height:.0f}" role="img">',
        f"<title>Control structure</title><desc>{_escaped_line(analysis.structure.about)}</desc>",
        f"<style>{STYLE_SHEET}</style>",
        "<defs>",
        *(
            arrow_and_box_svg.tip_marker(
                f"tip-{colour[1:]}", 9, f'd="{arrow_and_box_svg.TIP_OUTLINE}" fill="{colour}"'
            )
            for colour in (ACTION_COLOUR, FEEDBACK_COLOUR, FAULT_COLOUR)
        ),
        "</defs>",
        f'<rect width="{layout.width:.0f}" height="{height:.0f}" fill="#ffffff"/>',
        *_link_arrows(analysis, layout),
        *_component_boxes(analysis, layout),
        *_link_labels(analysis, layout),
        *_legend_lines(layout.height),
        "</svg>",
    ]
    return "\n".join(lines) + "\n"


def factors_with_faults_by_place(analysis: HazardAnalysis) -> dict[str, list[str]]:
    """Return the links and components at which faults enter, with the causal factors of these faults."""
    places: dict[str, list[str]] = {}
    for name, factor in analysis.factors_by_id.items():
        for place in factor.where if factor.faults else ():
            places.setdefault(place, []).append(name)
    return places


def _escaped_line(text: str) -> str:
    return escape(" ".join(text.split()))


def _link_arrows(analysis: HazardAnalysis, layout: StructureLayout) -> Iterator[str]:
    faulty = factors_with_faults_by_place(analysis)
    actions = {action.link for action in analysis.structure.control_actions.values()}
    for name, link in analysis.structure.links.items():
        colour = FAULT_COLOUR if name in faulty else ACTION_COLOUR if name in actions else FEEDBACK_COLOUR
        width = 2.6 if colour != FEEDBACK_COLOUR else 1.4
        yield _arrow_path(layout.arrow_by_link[name].corners, colour, width, dashed=not link.studied)


def _arrow_path(points: Iterable[Point], colour: str, width: float, *, dashed: bool = False) -> str:
    dashes = ' stroke-dasharray="6 4"' if dashed else ""
    return (
        f'<path d="{arrow_and_box_svg.svg_path_data(points)}" fill="none" stroke="{colour}" '
        f'stroke-width="{width}"{dashes} marker-end="url(#tip-{colour[1:]})"/>'
    )


def _component_boxes(analysis: HazardAnalysis, layout: StructureLayout) -> Iterator[str]:
    faulty = factors_with_faults_by_place(analysis)
    for name, component in analysis.structure.components.items():
        box = layout.box_by_component[name]
        edge, width = (FAULT_COLOUR, 3) if name in faulty else (INK_COLOUR, 1.2)
        look = f' fill="{FILL_BY_COMPONENT_KIND[component.kind]}" stroke="{edge}" stroke-width="{width}"'
        rectangle = arrow_and_box_svg.box_rectangle(box, look)
        yield f"<g><title>{_escaped_line(component.about)}</title>{rectangle}"
        yield from _box_text(box)
        yield "</g>"


def _box_text(box: ComponentBox) -> Iterator[str]:
    first = box.y + box.height / 2.0 - 17 * (len(box.text_lines) - 1) / 2.0 + 5
    for i, line in enumerate(box.text_lines):
        name = "" if i else ' class="name"'
        yield (
            f'<text{name} x="{box.x + box.width / 2.0:.1f}" y="{first + 17 * i:.1f}" '
            f'text-anchor="middle">{_escaped_line(line)}</text>'
        )


def _link_labels(analysis: HazardAnalysis, layout: StructureLayout) -> Iterator[str]:
    faulty = factors_with_faults_by_place(analysis)
    for name, link in analysis.structure.links.items():
        arrow = layout.arrow_by_link[name]
        yield arrow_and_box_svg.label_line(arrow, _escaped_line(link.label))
        if name in faulty:
            yield arrow_and_box_svg.label_line(
                arrow, _escaped_line(join_with_common_prefix(faulty[name])), 1, "label factor"
            )


def join_with_common_prefix(names: list[str]) -> str:
    """Join names and write their common prefix once: CF9, 10, 11."""
    first, *rest = names
    prefix = first.rstrip("0123456789")
    return ", ".join([first, *(name.removeprefix(prefix) for name in rest)])


def _legend_lines(top: float) -> Iterator[str]:
    entries = (
        (ACTION_COLOUR, 2.6, False, "control action"),
        (FEEDBACK_COLOUR, 1.4, False, "feedback, effect"),
        (FAULT_COLOUR, 2.6, False, "faults are injected here, for the causal factors named"),
        (FEEDBACK_COLOUR, 1.4, True, "not studied"),
    )
    x, y = float(DRAWING_EDGE), top + LEGEND_HEIGHT / 2.0
    for colour, width, dashed, words in entries:
        yield _arrow_path([(x, y), (x + 44, y)], colour, width, dashed=dashed)
        yield f'<text x="{x + 52:.1f}" y="{y + 5:.1f}">{words}</text>'
        x += 52 + 7 * len(words) + 36
