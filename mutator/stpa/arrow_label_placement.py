"""Place labels next to their arrows, clear of boxes, other arrows and other labels.

Lengths are in px; y points down. A label has two lines: what the arrow carries, and a second text from the
drawing.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

_SHIFT_STEP = 6  # step between the places that are tried
_LINE_DISTANCE_BESIDE, _LINE_DISTANCE_ACROSS = (
    17,
    25,
)  # distance between a label's lines, next to an arrow and across it
_LETTER_WIDTH = 7  # average width of a letter
_MIN_LABEL_WIDTH = 126  # room for text such as `1092 of 1128, 97 %`
_ASCENT, _DESCENT = 12, 4

Point = tuple[float, float]
Area = tuple[float, float, float, float]  # left, top, right, bottom


@dataclass(frozen=True, slots=True, kw_only=True)
class PlacedLabel:
    """The baseline of a label's first line, the SVG `anchor` of its lines, and their distance."""

    baseline: Point
    anchor: str
    line_distance: float


def place_labels(
    text_by_arrow: Mapping[str, str], corners_by_arrow: Mapping[str, Sequence[Point]], boxes: Iterable[Area]
) -> dict[str, PlacedLabel]:
    """Find a place for the label of each arrow in `arrows` (lists of corners); the preferred place if none is
    clear.
    """
    occupied = list(boxes)
    lines = {
        name: [_segment_area(a, b) for a, b in pairwise(points)] for name, points in corners_by_arrow.items()
    }
    labels: dict[str, PlacedLabel] = {}
    for name in sorted(
        text_by_arrow, key=lambda name: _segment_length(*_label_segment(corners_by_arrow[name]))
    ):
        others = [area for other, areas in lines.items() if other != name for area in areas]
        width = max(_LETTER_WIDTH * len(text_by_arrow[name]), _MIN_LABEL_WIDTH)
        places = list(_label_places(corners_by_arrow[name], width))
        labels[name] = next(
            (place for place in places if not _overlaps_any(_label_area(place, width), (*occupied, *others))),
            places[0],
        )
        occupied.append(_label_area(labels[name], width))
    return {name: labels[name] for name in text_by_arrow}


def _label_segment(points: Sequence[Point]) -> tuple[Point, Point]:
    """Return the segment of an arrow that carries the label, a horizontal one if possible."""
    return next((pair for pair in pairwise(points) if pair[0][1] == pair[1][1]), (points[0], points[-1]))


def _segment_length(start: Point, end: Point) -> float:
    return abs(start[0] - end[0]) + abs(start[1] - end[1])


def _label_places(points: Sequence[Point], width: float) -> Iterator[PlacedLabel]:
    """Yield places for a label, the best first: at a horizontal segment, from its middle outwards, or
    next to a vertical one, from its tip, where the fewest other arrows cross.
    """
    (x1, y1), (x2, y2) = _label_segment(points)
    if y1 == y2:
        middle, free = (x1 + x2) / 2, max(abs(x1 - x2) - width, 0) / 2
        for shift in _shifts_outward(free):
            yield PlacedLabel(
                baseline=(middle + shift, y1 - 8), anchor="middle", line_distance=_LINE_DISTANCE_ACROSS
            )
        return
    best = y2 + 22 if y2 < y1 else y2 - 32
    away = 1 if y2 < y1 else -1
    for shift in range(0, int(abs(y1 - y2)) - 50, _SHIFT_STEP):
        yield PlacedLabel(
            baseline=(x1 + 6, best + away * shift), anchor="start", line_distance=_LINE_DISTANCE_BESIDE
        )
        yield PlacedLabel(
            baseline=(x1 - 6, best + away * shift), anchor="end", line_distance=_LINE_DISTANCE_BESIDE
        )


def _shifts_outward(most_shift: float) -> Iterator[float]:
    yield 0.0
    for shift in range(_SHIFT_STEP, int(most_shift) + 1, _SHIFT_STEP):
        yield from (float(shift), -float(shift))


def _label_area(label: PlacedLabel, width: float) -> Area:
    x, y = label.baseline
    x_left = x - {"start": 0.0, "middle": width / 2, "end": width}[label.anchor]
    return x_left, y - _ASCENT, x_left + width, y + label.line_distance + _DESCENT


def _segment_area(start: Point, end: Point) -> Area:
    (x1, x2), (y1, y2) = sorted((start[0], end[0])), sorted((start[1], end[1]))
    return x1 - 4, y1 - 1, x2 + 4, y2 + 1


def _overlaps_any(area: Area, others: Iterable[Area]) -> bool:
    return any(area[0] < o[2] and area[2] > o[0] and area[1] < o[3] and area[3] > o[1] for o in others)
