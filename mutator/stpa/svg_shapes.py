"""The SVG of arrows, their labels and boxes, in every drawing of a control structure. Lengths are in px."""

from collections.abc import Iterable

from mutator.stpa.arrow_labels import Point
from mutator.stpa.structure_layout import Arrow, Box

TIP = "M0,0 L10,5 L0,10 z"  # outline of an arrow's tip
_LINE = 15  # line spacing of a label's second text


def tip(name: str, size: int, shape: str) -> str:
    """Return the marker that ends arrows. `shape` are the attributes of its path, with `TIP` as `d`."""
    return (
        f'<marker id="{name}" viewBox="0 0 10 10" refX="9" refY="5" markerWidth="{size}" '
        f'markerHeight="{size}" markerUnits="userSpaceOnUse" orient="auto"><path {shape}/></marker>'
    )


def course(points: Iterable[Point]) -> str:
    """Return the data of the path through these points."""
    return "M" + " L".join(f"{x:.1f},{y:.1f}" for x, y in points)


def label(arrow: Arrow, markup: str, line: int = 0, kind: str = "label") -> str:
    """Return a line of an arrow's label: 0 is what it carries, 1 and 2 are the drawing's second text."""
    x, y = arrow.label.at
    y += (0, arrow.label.apart, arrow.label.apart + _LINE)[line]
    return f'<text class="{kind}" x="{x:.1f}" y="{y:.1f}" text-anchor="{arrow.label.anchor}">{markup}</text>'


def rectangle(box: Box, more: str = "") -> str:
    """Return a box without its text. `more` are further attributes, each after a space."""
    place = f'x="{box.x:.1f}" y="{box.y:.1f}" width="{box.width:.1f}" height="{box.height:.1f}"'
    return f'<rect {place} rx="7"{more}/>'
