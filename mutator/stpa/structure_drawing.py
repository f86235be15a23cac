"""Draw the control structure as SVG and highlight where faults are injected."""

from collections.abc import Iterable, Iterator
from html import escape

from mutator.stpa import svg_shapes
from mutator.stpa.analysis_files import Analysis, Kind
from mutator.stpa.arrow_labels import Point
from mutator.stpa.structure_layout import EDGE, Box, Layout, lay_out

FILLS = {
    Kind.HUMAN: "#ececec",
    Kind.CONTROLLER: "#dbe9f6",
    Kind.ESTIMATOR: "#e3f1ea",
    Kind.ACTUATOR: "#fbeed5",
    Kind.SENSOR: "#e8e4f3",
    Kind.PROCESS: "#f3f3f3",
}
INK = "#222222"
# Okabe and Ito's palette, for colour-blind readers; dashes and width carry the same information.
ACTION, FEEDBACK, FAULT = "#0072b2", "#555555", "#d55e00"
LEGEND = 54  # height of the key at the bottom, in px
STYLE = (
    "text{font-family:Helvetica,Arial,sans-serif;font-size:13px;fill:#222222}"
    ".name{font-weight:bold;font-size:14px}"
    ".label{paint-order:stroke;stroke:#ffffff;stroke-width:4px;stroke-linejoin:round}"
    ".factor{font-size:11px;font-weight:bold;fill:#d55e00}"
)


def draw(analysis: Analysis) -> str:
    """Return the SVG text, which is deterministic."""
    layout = lay_out(analysis.structure)
    height = layout.height + LEGEND
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {layout.width:.0f} {height:.0f}" '
        f'width="{layout.width:.0f}" height="{height:.0f}" role="img">',
        f"<title>Control structure</title><desc>{_text(analysis.structure.about)}</desc>",
        f"<style>{STYLE}</style>",
        "<defs>",
        *(
            svg_shapes.tip(f"tip-{colour[1:]}", 9, f'd="{svg_shapes.TIP}" fill="{colour}"')
            for colour in (ACTION, FEEDBACK, FAULT)
        ),
        "</defs>",
        f'<rect width="{layout.width:.0f}" height="{height:.0f}" fill="#ffffff"/>',
        *_links(analysis, layout),
        *_components(analysis, layout),
        *_labels(analysis, layout),
        *_legend(layout.height),
        "</svg>",
    ]
    return "\n".join(lines) + "\n"


def faulty_places(analysis: Analysis) -> dict[str, list[str]]:
    """Return the links and components at which faults enter, with the causal factors of these faults."""
    places: dict[str, list[str]] = {}
    for name, factor in analysis.factors.items():
        for place in factor.where if factor.faults else ():
            places.setdefault(place, []).append(name)
    return places


def _text(text: str) -> str:
    return escape(" ".join(text.split()))


def _links(analysis: Analysis, layout: Layout) -> Iterator[str]:
    faulty = faulty_places(analysis)
    actions = {action.link for action in analysis.structure.control_actions.values()}
    for name, link in analysis.structure.links.items():
        colour = FAULT if name in faulty else ACTION if name in actions else FEEDBACK
        width = 2.6 if colour != FEEDBACK else 1.4
        yield _line(layout.arrows[name].points, colour, width, dashed=not link.studied)


def _line(points: Iterable[Point], colour: str, width: float, *, dashed: bool = False) -> str:
    dashes = ' stroke-dasharray="6 4"' if dashed else ""
    return (
        f'<path d="{svg_shapes.course(points)}" fill="none" stroke="{colour}" stroke-width="{width}"{dashes} '
        f'marker-end="url(#tip-{colour[1:]})"/>'
    )


def _components(analysis: Analysis, layout: Layout) -> Iterator[str]:
    faulty = faulty_places(analysis)
    for name, component in analysis.structure.components.items():
        box = layout.boxes[name]
        edge, width = (FAULT, 3) if name in faulty else (INK, 1.2)
        look = f' fill="{FILLS[component.kind]}" stroke="{edge}" stroke-width="{width}"'
        yield f"<g><title>{_text(component.about)}</title>{svg_shapes.rectangle(box, look)}"
        yield from _box_text(box)
        yield "</g>"


def _box_text(box: Box) -> Iterator[str]:
    first = box.y + box.height / 2.0 - 17 * (len(box.lines) - 1) / 2.0 + 5
    for i, line in enumerate(box.lines):
        name = "" if i else ' class="name"'
        yield (
            f'<text{name} x="{box.x + box.width / 2.0:.1f}" y="{first + 17 * i:.1f}" '
            f'text-anchor="middle">{_text(line)}</text>'
        )


def _labels(analysis: Analysis, layout: Layout) -> Iterator[str]:
    faulty = faulty_places(analysis)
    for name, link in analysis.structure.links.items():
        arrow = layout.arrows[name]
        yield svg_shapes.label(arrow, _text(link.label))
        if name in faulty:
            yield svg_shapes.label(arrow, _text(short(faulty[name])), 1, "label factor")


def short(names: list[str]) -> str:
    """Join names and write their common prefix once: CF9, 10, 11."""
    first, *rest = names
    prefix = first.rstrip("0123456789")
    return ", ".join([first, *(name.removeprefix(prefix) for name in rest)])


def _legend(top: float) -> Iterator[str]:
    entries = (
        (ACTION, 2.6, False, "control action"),
        (FEEDBACK, 1.4, False, "feedback, effect"),
        (FAULT, 2.6, False, "faults are injected here, for the causal factors named"),
        (FEEDBACK, 1.4, True, "not studied"),
    )
    x, y = float(EDGE), top + LEGEND / 2.0
    for colour, width, dashed, words in entries:
        yield _line([(x, y), (x + 44, y)], colour, width, dashed=dashed)
        yield f'<text x="{x + 52:.1f}" y="{y + 5:.1f}">{words}</text>'
        x += 52 + 7 * len(words) + 36
