"""Place labels next to their arrows, clear of boxes, other arrows and other labels.

Lengths are in px; y points down. A label has two lines: what the arrow carries, and a second text from the
drawing.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

_STEP = 6  # step between the places that are tried
_BESIDE, _ACROSS = 17, 25  # distance between a label's lines, next to an arrow and across it
_LETTER = 7  # average width of a letter
_SHORTEST = 126  # room for text such as `1092 of 1128, 97 %`
_ASCENT, _DESCENT = 12, 4

Point = tuple[float, float]
Area = tuple[float, float, float, float]  # left, top, right, bottom


@dataclass(frozen=True, slots=True, kw_only=True)
class Label:
    """The baseline of a label's first line, the SVG `anchor` of its lines, and their distance."""

    at: Point
    anchor: str
    apart: float


def place_labels(
    words: Mapping[str, str], arrows: Mapping[str, Sequence[Point]], boxes: Iterable[Area]
) -> dict[str, Label]:
    """Find a place for the label of each arrow in `arrows` (lists of corners); the preferred place if none is
    clear.
    """
    taken = list(boxes)
    lines = {name: [_around(a, b) for a, b in pairwise(points)] for name, points in arrows.items()}
    found: dict[str, Label] = {}
    for name in sorted(words, key=lambda name: _length(*_bearer(arrows[name]))):
        others = [area for other, areas in lines.items() if other != name for area in areas]
        width = max(_LETTER * len(words[name]), _SHORTEST)
        places = list(_places(arrows[name], width))
        found[name] = next(
            (place for place in places if not _meets_any(_area(place, width), (*taken, *others))), places[0]
        )
        taken.append(_area(found[name], width))
    return {name: found[name] for name in words}


def _bearer(points: Sequence[Point]) -> tuple[Point, Point]:
    """Return the segment of an arrow that carries the label, a horizontal one if possible."""
    return next((pair for pair in pairwise(points) if pair[0][1] == pair[1][1]), (points[0], points[-1]))


def _length(start: Point, end: Point) -> float:
    return abs(start[0] - end[0]) + abs(start[1] - end[1])


def _places(points: Sequence[Point], width: float) -> Iterator[Label]:
    """Yield places for a label, the best first: at a horizontal segment, from its middle outwards, or
    next to a vertical one, from its tip, where the fewest other arrows cross.
    """
    (x1, y1), (x2, y2) = _bearer(points)
    if y1 == y2:
        middle, free = (x1 + x2) / 2, max(abs(x1 - x2) - width, 0) / 2
        for shift in _outward(free):
            yield Label(at=(middle + shift, y1 - 8), anchor="middle", apart=_ACROSS)
        return
    best = y2 + 22 if y2 < y1 else y2 - 32
    away = 1 if y2 < y1 else -1
    for shift in range(0, int(abs(y1 - y2)) - 50, _STEP):
        yield Label(at=(x1 + 6, best + away * shift), anchor="start", apart=_BESIDE)
        yield Label(at=(x1 - 6, best + away * shift), anchor="end", apart=_BESIDE)


def _outward(most: float) -> Iterator[float]:
    yield 0.0
    for shift in range(_STEP, int(most) + 1, _STEP):
        yield from (float(shift), -float(shift))


def _area(label: Label, width: float) -> Area:
    x, y = label.at
    left = x - {"start": 0.0, "middle": width / 2, "end": width}[label.anchor]
    return left, y - _ASCENT, left + width, y + label.apart + _DESCENT


def _around(start: Point, end: Point) -> Area:
    (x1, x2), (y1, y2) = sorted((start[0], end[0])), sorted((start[1], end[1]))
    return x1 - 4, y1 - 1, x2 + 4, y2 + 1


def _meets_any(area: Area, others: Iterable[Area]) -> bool:
    return any(area[0] < o[2] and area[2] > o[0] and area[1] < o[3] and area[3] > o[1] for o in others)
