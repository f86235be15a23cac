"""Draws the plane of an envelope as a small SVG: cells over duration and magnitude, on logarithmic axes.

Only its colours are left to `envelopes.css`. Dots are runs, shades what is said of each cell.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from html import escape
from itertools import groupby

from mutator.explore.cell_results import CellState
from mutator.explore.envelope import Envelope
from mutator.explore.lattice import Cell, cell_edges
from mutator.explore.plane_search import cells_with

_LEFT, _TOP, _RIGHT, _BOTTOM = 44, 8, 8, 32  # px around the cells
_WIDTH, _HEIGHT, _LINE_HEIGHT = 300, 190, 40  # px of the cells; the last one is for a fault without a value
_LEAST_TICK_DISTANCE = 26  # px
_CLASS_BY_STATE = {
    CellState.WITHOUT_HAZARD: "survived",
    CellState.BETWEEN_WITHOUT: "survived",
    CellState.HAZARDOUS: "failed",
    CellState.BETWEEN_HAZARDOUS: "failed",
    CellState.INFERRED: "inferred",
    CellState.DISENGAGED: "open",
    CellState.NOT_DECIDED: "open",
    CellState.UNKNOWN: "open",
}
_CLASS_OF_DOTS = {
    CellState.WITHOUT_HAZARD: "survived",
    CellState.HAZARDOUS: "failed",
    CellState.NOT_DECIDED: "open",
}
_Edges = Sequence[int]  # px, of the cells of an axis


def draw_plane(envelope: Envelope, description: str) -> str:
    """Return the SVG; `description` is its text alternative."""
    sizes = [abs(value) for value in envelope.magnitudes if value is not None]
    height = _HEIGHT if sizes else _LINE_HEIGHT
    x_edges, y_edges = cell_edges(envelope.durations_s), cell_edges(sizes or [1.0])
    xs = [_LEFT + round(_position(x_edges, x) * _WIDTH) for x in x_edges]
    ys = [_TOP + height - round(_position(y_edges, y) * height) for y in y_edges]
    dots_x = [_LEFT + round(_position(x_edges, x) * _WIDTH) for x in envelope.durations_s]
    dots_y = [_TOP + height - round(_position(y_edges, y) * height) for y in sizes or [1.0]]
    total = _LEFT + _WIDTH + _RIGHT, _TOP + height + _BOTTOM
    parts = [
        f'<svg class="plane" xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {total[0]} {total[1]}" '
        f'width="{total[0]}" height="{total[1]}" role="img" aria-label="{escape(description)}">',
        *_shades(envelope, xs, ys),
        *(f'<path class="island" d="{_outline(island, xs, ys)}"/>' for island in envelope.islands()),
        *_dots(envelope, dots_x, dots_y),
        *_x_axis(x_edges, _TOP + height),
        *(_y_axis(envelope, y_edges, height) if sizes else ()),
        "</svg>",
    ]
    return "".join(parts)


def _position(edges: Sequence[float], value: float) -> float:
    return math.log(value / edges[0]) / math.log(edges[-1] / edges[0])


def _shades(envelope: Envelope, xs: _Edges, ys: _Edges) -> Iterator[str]:
    """Yield a path for each kind of cell, with neighbours of a line as one rectangle."""
    rectangles: dict[str, list[str]] = {}
    for i, line in enumerate(envelope.cells):
        begin = 0
        for name, group in groupby(_CLASS_BY_STATE[state] for state in line):
            end = begin + sum(1 for _ in group)
            width, height = xs[end] - xs[begin], ys[i] - ys[i + 1]
            rectangles.setdefault(name, []).append(f"M{xs[begin]} {ys[i + 1]}h{width}v{height}h-{width}z")
            begin = end
    for name, paths in sorted(rectangles.items()):
        yield f'<path class="{name}" d="{"".join(paths)}"/>'


def _dots(envelope: Envelope, xs: _Edges, ys: _Edges) -> Iterator[str]:
    for state, name in _CLASS_OF_DOTS.items():
        cells = cells_with((state,), envelope.cells)
        if paths := "".join(f"M{xs[j]} {ys[i]}h0" for i, j in cells):
            yield f'<path class="dots {name}" d="{paths}"/>'
    disengaged = cells_with((CellState.DISENGAGED,), envelope.cells)
    if paths := "".join(f"M{xs[j] - 3} {ys[i] - 3}l6 6m0-6l-6 6" for i, j in disengaged):
        yield f'<path class="crosses" d="{paths}"/>'


def _outline(cells: Iterable[Cell], xs: _Edges, ys: _Edges) -> str:
    group = set(cells)
    parts = []
    for i, j in sorted(group):
        left, right, low, high = xs[j], xs[j + 1], ys[i], ys[i + 1]
        edge_by_neighbour = {
            (i - 1, j): f"M{left} {low}H{right}",
            (i + 1, j): f"M{left} {high}H{right}",
            (i, j - 1): f"M{left} {low}V{high}",
            (i, j + 1): f"M{right} {low}V{high}",
        }
        parts += [edge for neighbour, edge in edge_by_neighbour.items() if neighbour not in group]
    return "".join(parts)


def _x_axis(edges: Sequence[float], top: int) -> Iterator[str]:
    right = _LEFT + _WIDTH
    yield f'<path class="axis" d="M{_LEFT} {_TOP}V{top}H{right}"/>'
    for value, share in _ticks(edges, _WIDTH):
        yield f'<text x="{_LEFT + share:.0f}" y="{top + 13}" text-anchor="middle">{value:g}</text>'
    yield f'<text class="unit" x="{right}" y="{top + 27}" text-anchor="end">duration [s]</text>'


def _y_axis(envelope: Envelope, edges: Sequence[float], height: int) -> Iterator[str]:
    sign = "-" if (envelope.magnitudes[0] or 0.0) < 0 else ""
    for value, share in _ticks(edges, height):
        y = _TOP + height - share + 3
        yield f'<text x="{_LEFT - 5}" y="{y:.0f}" text-anchor="end">{sign}{value:g}</text>'
    if unit := envelope.plane.unit:
        yield f'<text class="unit" x="2" y="{_TOP + height + 27}">{escape(unit)}</text>'


def _ticks(edges: Sequence[float], length: int) -> Iterator[tuple[float, float]]:
    """Yield round numbers within an axis and their places in px; those of 1, 10, 100 ... first."""
    places: list[float] = []
    exponents = range(math.floor(math.log10(edges[0])), math.ceil(math.log10(edges[-1])) + 1)
    for factor in (1, 2, 5):
        for exponent in exponents:
            value = factor * 10.0**exponent
            place = _position(edges, value) * length
            if 0 <= place <= length and all(abs(place - p) >= _LEAST_TICK_DISTANCE for p in places):
                places.append(place)
                yield value, place
