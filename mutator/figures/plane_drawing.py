"""Draws the plane of an envelope, or of two over each other, as a small SVG.

Cells are over duration and magnitude, on logarithmic axes. Only colours are left to `envelopes.css`. Dots are
runs, shades what is said of each cell.
"""

import math
from collections.abc import Iterable, Iterator, Sequence, Set
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


class _Grid:
    """Where the cells of a lattice are, in px: `xs` and `ys` are their edges."""

    def __init__(self, envelope: Envelope) -> None:
        sizes = [abs(value) for value in envelope.magnitudes if value is not None]
        self.envelope, self.has_sizes = envelope, bool(sizes)
        self.height = _HEIGHT if sizes else _LINE_HEIGHT
        self.x_edges, self.y_edges = cell_edges(envelope.durations_s), cell_edges(sizes or [1.0])
        self.xs, self.ys = self.xs_of(self.x_edges), self.ys_of(self.y_edges)
        self.dots_x, self.dots_y = self.xs_of(envelope.durations_s), self.ys_of(sizes or [1.0])

    def xs_of(self, durations_s: Sequence[float]) -> _Edges:
        return [_LEFT + round(_position(self.x_edges, x) * _WIDTH) for x in durations_s]

    def ys_of(self, sizes: Sequence[float]) -> _Edges:
        return [_TOP + self.height - round(_position(self.y_edges, y) * self.height) for y in sizes]

    def framed(self, shapes: Iterable[str], description: str) -> str:
        """Return the SVG of these shapes, with axes."""
        total = _LEFT + _WIDTH + _RIGHT, _TOP + self.height + _BOTTOM
        parts = [
            f'<svg class="plane" xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {total[0]} {total[1]}" '
            f'width="{total[0]}" height="{total[1]}" role="img" aria-label="{escape(description)}">',
            *shapes,
            *_x_axis(self.x_edges, _TOP + self.height),
            *(_y_axis(self.envelope, self.y_edges, self.height) if self.has_sizes else ()),
            "</svg>",
        ]
        return "".join(parts)


def draw_plane(envelope: Envelope, description: str) -> str:
    """Return the SVG; `description` is its text alternative."""
    grid = _Grid(envelope)
    names = [[_CLASS_BY_STATE[state] for state in line] for line in envelope.cells]
    islands = (_outline(island, grid.xs, grid.ys) for island in envelope.islands())
    shapes = [
        *_shades(names, grid.xs, grid.ys),
        *(f'<path class="island" d="{island}"/>' for island in islands),
        *_dots(envelope, grid.dots_x, grid.dots_y),
    ]
    return grid.framed(shapes, description)


def draw_two_planes(before: Envelope, after: Envelope, description: str) -> str:
    """Return the SVG of two envelopes of one lattice over each other: the border of what is hazardous in
    each, and the cells of which they say different things.
    """
    grid = _Grid(after)
    names = [
        [_class_of_change(was, now) for was, now in zip(*lines, strict=True)]
        for lines in zip(before.cells, after.cells, strict=True)
    ]
    shapes = list(_shades(names, grid.xs, grid.ys))
    for name, envelope in (("before", before), ("after", after)):
        if border := _border_of_hazards(envelope, grid.xs, grid.ys):
            shapes.append(f'<path class="border {name}" d="{border}"/>')
    return grid.framed(shapes, description)


def _class_of_change(was: CellState, now: CellState) -> str:
    if was.is_without_hazard and now.is_hazardous:
        return "worse"
    if was.is_hazardous and now.is_without_hazard:
        return "better"
    if was.is_without_hazard and not now.is_without_hazard:
        return "lost"
    if was.is_hazardous and now.is_hazardous:
        return "failed"
    return "survived" if now.is_without_hazard and was.is_without_hazard else "open"


def _border_of_hazards(envelope: Envelope, xs: _Edges, ys: _Edges) -> str:
    """Return the border between hazardous cells and others, without the edge of the plane."""
    lines, durations = range(len(envelope.magnitudes)), range(len(envelope.durations_s))
    hazardous = [(i, j) for i in lines for j in durations if envelope.cells[i][j].is_hazardous]
    beyond = {(i, j) for i in (-1, len(lines)) for j in durations}
    beyond |= {(i, j) for i in lines for j in (-1, len(durations))}
    return _outline(hazardous, xs, ys, beyond)


def _position(edges: Sequence[float], value: float) -> float:
    return math.log(value / edges[0]) / math.log(edges[-1] / edges[0])


def _shades(names: Sequence[Sequence[str]], xs: _Edges, ys: _Edges) -> Iterator[str]:
    """Yield a path for each kind of cell, with neighbours of a line as one rectangle."""
    rectangles: dict[str, list[str]] = {}
    for i, line in enumerate(names):
        begin = 0
        for name, group in groupby(line):
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


def _outline(cells: Iterable[Cell], xs: _Edges, ys: _Edges, beside: Set[Cell] = frozenset()) -> str:
    """Return the edges between cells and all others but those `beside`."""
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
        parts += [edge for neighbour, edge in edge_by_neighbour.items() if neighbour not in group | beside]
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
