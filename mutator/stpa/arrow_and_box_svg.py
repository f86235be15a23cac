"""The SVG of arrows, their labels and boxes, in every drawing of a control structure. Lengths are in px."""

from collections.abc import Iterable

from mutator.stpa.arrow_label_placement import Point
from mutator.stpa.control_structure_layout import ComponentBox, LinkArrow

TIP_OUTLINE = "M0,0 L10,5 L0,10 z"  # outline of an arrow's tip
_LINE_SPACING = 15  # line spacing of a label's second text


def tip_marker(name: str, size: int, path_attributes: str) -> str:
    """Return the marker that ends arrows. `shape` are the attributes of its path, with `TIP_OUTLINE` as
    `d`.
    """
    return (
        f'<marker id="{name}" viewBox="0 0 10 10" refX="9" refY="5" markerWidth="{size}" '
        f'markerHeight="{size}" markerUnits="userSpaceOnUse" orient="auto"><path {path_attributes}/></marker>'
    )


def svg_path_data(points: Iterable[Point]) -> str:
    """Return the data of the path through these points."""
    return "M" + " L".join(f"{x:.1f},{y:.1f}" for x, y in points)


def label_line(arrow: LinkArrow, markup: str, line_number: int = 0, css_class: str = "label") -> str:
    """Return a line of an arrow's label: 0 is what it carries, 1 and 2 are the drawing's second text."""
    x, y = arrow.label.baseline
    y += (0, arrow.label.line_distance, arrow.label.line_distance + _LINE_SPACING)[line_number]
    place = f'x="{x:.1f}" y="{y:.1f}" text-anchor="{arrow.label.anchor}"'
    return f'<text class="{css_class}" {place}>{markup}</text>'


def box_rectangle(box: ComponentBox, more_attributes: str = "") -> str:
    """Return a box without its text. `more_attributes` are further attributes, each after a space."""
    place = f'x="{box.x:.1f}" y="{box.y:.1f}" width="{box.width:.1f}" height="{box.height:.1f}"'
    return f'<rect {place} rx="7"{more_attributes}/>'
