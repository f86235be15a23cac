"""Lay out a control structure: rows of boxes, and between them channels with one track per arrow.

Lengths are in px; y points down. An arrow that cannot go straight up or down gets a separate track between
two rows; one that would cross a box runs along the left margin.
"""

from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass

from mutator.stpa.arrow_label_placement import PlacedLabel, Point, place_labels
from mutator.stpa.hazard_analysis_yaml import ComponentModel, ControlStructureModel, LinkModel

COLUMN_PITCH = 212  # distance between columns
BOX_GAP = 88  # distance between adjacent boxes
LEFT_MARGIN = 110  # margin left of the first column, for arrows around the rows
DRAWING_EDGE = 20
BOX_HEIGHT = 46
TEXT_LINE_HEIGHT = 17  # height of each further line of text in a box
ARROW_TRACK_HEIGHT = 44
ROW_GAP_HEIGHT = 64  # height of a channel without tracks
MIN_ARROW_DISTANCE = 24  # distance between parallel arrows


@dataclass(frozen=True, slots=True, kw_only=True)
class ComponentBox:
    """A drawn component."""

    x: float
    y: float
    width: float
    height: float
    row: int
    text_lines: tuple[str, ...]

    @property
    def bottom(self) -> float:
        return self.y + self.height

    def is_met_by_arrow_at(self, x: float) -> bool:
        """Whether an arrow at `x` meets the box, away from its corners."""
        return self.x + 8 <= x <= self.x + self.width - 8


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkArrow:
    """A drawn link: its corners from tail to tip, and the place of its label."""

    corners: tuple[Point, ...]
    label: PlacedLabel


@dataclass(frozen=True, slots=True, kw_only=True)
class StructureLayout:
    box_by_component: dict[str, ComponentBox]
    arrow_by_link: dict[str, LinkArrow]
    width: float
    height: float


def lay_out_structure(structure: ControlStructureModel, least_text_lines: int = 1) -> StructureLayout:
    """Place every component and link. Each box has room for at least `least_text_lines` lines of text."""
    boxes = _place_boxes(structure, least_text_lines)
    ports = _place_ports(structure.links, boxes)
    points: dict[str, tuple[Point, ...]] = {}
    used: dict[int, int] = defaultdict(int)
    for name, link in structure.links.items():
        tail, tip = boxes[link.from_], boxes[link.to]
        if tail.row == tip.row:
            points[name] = _sideways_points(tail, tip)
        elif _is_blocked(ports[name], tail, tip, boxes.values()):
            points[name] = _left_margin_points(tail, tip)
        elif ports[name][0] == ports[name][1]:
            points[name] = _straight_points(ports[name][0], tail, tip)
        else:
            row = min(tail.row, tip.row)
            used[row] += 1
            top = max(box.bottom for box in boxes.values() if box.row == row)
            points[name] = _elbow_points(ports[name], tail, tip, top + used[row] * ARROW_TRACK_HEIGHT)
    words = {name: link.label for name, link in structure.links.items()}
    areas = [(box.x, box.y, box.x + box.width, box.bottom) for box in boxes.values()]
    labels = place_labels(words, points, areas)
    return StructureLayout(
        box_by_component=boxes,
        arrow_by_link={name: LinkArrow(corners=points[name], label=labels[name]) for name in structure.links},
        width=max(box.x + box.width for box in boxes.values()) + DRAWING_EDGE,
        height=max(box.bottom for box in boxes.values()) + DRAWING_EDGE,
    )


def _place_boxes(structure: ControlStructureModel, least_text_lines: int) -> dict[str, ComponentBox]:
    components = structure.components
    heights: dict[int, float] = defaultdict(float)
    for component in components.values():
        height = BOX_HEIGHT + TEXT_LINE_HEIGHT * (max(len(_box_lines(component)), least_text_lines) - 1)
        heights[component.drawn[0]] = max(heights[component.drawn[0]], height)
    tops, y = {}, float(DRAWING_EDGE)
    for row in sorted(heights):
        tops[row] = y
        y += heights[row] + ROW_GAP_HEIGHT + ARROW_TRACK_HEIGHT * _count_tracks(structure, row)
    columns = max(component.drawn[1] + component.drawn[2] for component in components.values())
    boxes = {}
    for name, component in components.items():
        row, column, width = component.drawn
        all_along = LEFT_MARGIN if width == columns else 0
        boxes[name] = ComponentBox(
            x=DRAWING_EDGE + LEFT_MARGIN + column * COLUMN_PITCH - all_along,
            y=tops[row],
            width=width * COLUMN_PITCH - BOX_GAP + all_along,
            height=heights[row],
            row=row,
            text_lines=_box_lines(component),
        )
    return boxes


def _count_tracks(structure: ControlStructureModel, row: int) -> int:
    """Return the number of arrows that need a track below `row`, because their ends have no common column."""
    count = 0
    for link in structure.links.values():
        (row1, first1, width1), (row2, first2, width2) = (
            structure.components[name].drawn for name in (link.from_, link.to)
        )
        common = first1 < first2 + width2 and first2 < first1 + width1
        count += row1 != row2 and min(row1, row2) == row and not common
    return count


def _box_lines(component: ComponentModel) -> tuple[str, ...]:
    names = [name.replace("_", " ") for name in component.process_model]
    pairs = [", ".join(names[i : i + 2]) for i in range(0, len(names), 2)]
    return (component.label, *pairs)


def _place_ports(
    links: dict[str, LinkModel], boxes: dict[str, ComponentBox]
) -> dict[str, tuple[float, float]]:
    """Return the x of each link's tail and tip: the same x if possible, otherwise apart from all others."""
    ports = dict.fromkeys(links, (0.0, 0.0))
    edges: dict[tuple[str, bool], list[str]] = defaultdict(list)  # (box, at its lower edge) -> its links
    for name, link in links.items():
        down = boxes[link.from_].row < boxes[link.to].row
        if boxes[link.from_].row != boxes[link.to].row:
            edges[link.from_, down].append(name)
            edges[link.to, not down].append(name)
    x_by_channel: dict[int, list[float]] = defaultdict(list)  # channel -> x of the arrows in it
    bent = []
    for name, link in links.items():
        if boxes[link.from_].row == boxes[link.to].row:
            continue
        tail, tip = (_spread_port(end, name, edges, links, boxes) for end in (link.from_, link.to))
        narrow = tail if boxes[link.from_].width <= boxes[link.to].width else tip
        if boxes[link.from_].is_met_by_arrow_at(narrow) and boxes[link.to].is_met_by_arrow_at(narrow):
            ports[name] = (narrow, narrow)
            x_by_channel[min(boxes[link.from_].row, boxes[link.to].row)].append(narrow)
        else:
            bent.append((name, tail, tip))
    for name, tail, tip in bent:
        others = x_by_channel[min(boxes[links[name].from_].row, boxes[links[name].to].row)]
        ports[name] = (
            _free_port(tail, tip, boxes[links[name].from_], others),
            _free_port(tip, tail, boxes[links[name].to], others),
        )
    return ports


def _spread_port(
    box_name: str,
    name: str,
    edges: dict[tuple[str, bool], list[str]],
    links: dict[str, LinkModel],
    boxes: dict[str, ComponentBox],
) -> float:
    """Return the x of a link at the box `box_name`. The links of an edge are spread evenly, in the order of
    their other ends.
    """
    other = links[name].to if links[name].from_ == box_name else links[name].from_
    mates = edges[box_name, boxes[box_name].row < boxes[other].row]
    mates = sorted(mates, key=lambda mate: _middle_of_other_box(boxes, links[mate], box_name))
    return boxes[box_name].x + boxes[box_name].width * (mates.index(name) + 1) / (len(mates) + 1)


def _free_port(x: float, toward: float, box: ComponentBox, others: list[float]) -> float:
    """Return the place on the box's edge that is nearest to `x` and at least `MIN_ARROW_DISTANCE` from
    `others`. It is added to `others`.

    The side towards the other end, `toward`, is tried first, because this saves a crossing.
    """
    side = 1.0 if toward > x else -1.0
    edge = range(int(box.x) + 10, int(box.x + box.width) - 9)
    places = sorted(edge, key=lambda place: ((place - x) * side < -1.0, abs(place - x)))
    free = (p for p in places if all(abs(p - other) >= MIN_ARROW_DISTANCE for other in others))
    others.append(next(free, x))
    return others[-1]


def _middle_of_other_box(boxes: dict[str, ComponentBox], link: LinkModel, box_name: str) -> float:
    other = boxes[link.to if link.from_ == box_name else link.from_]
    return other.x + other.width / 2.0


def _is_blocked(
    ports: tuple[float, float], tail: ComponentBox, tip: ComponentBox, boxes: Iterable[ComponentBox]
) -> bool:
    """Whether a box between the rows is in the way of the long vertical part of the arrow."""
    upper, lower = sorted((tail.row, tip.row))
    x = ports[0] if tail.row > tip.row else ports[1]
    return any(upper < box.row < lower and box.x - 8 <= x <= box.x + box.width + 8 for box in boxes)


def _vertical_ends(tail: ComponentBox, tip: ComponentBox) -> tuple[float, float]:
    return (tail.bottom, tip.y) if tail.row < tip.row else (tail.y, tip.bottom)


def _straight_points(x: float, tail: ComponentBox, tip: ComponentBox) -> tuple[Point, ...]:
    y1, y2 = _vertical_ends(tail, tip)
    return (x, y1), (x, y2)


def _elbow_points(
    ports: tuple[float, float], tail: ComponentBox, tip: ComponentBox, y: float
) -> tuple[Point, ...]:
    (x1, x2), (y1, y2) = ports, _vertical_ends(tail, tip)
    return (x1, y1), (x1, y), (x2, y), (x2, y2)


def _sideways_points(tail: ComponentBox, tip: ComponentBox) -> tuple[Point, ...]:
    y = tail.y + tail.height / 2.0
    x1, x2 = (tail.x + tail.width, tip.x) if tail.x < tip.x else (tail.x, tip.x + tip.width)
    return (x1, y), (x2, y)


def _left_margin_points(tail: ComponentBox, tip: ComponentBox) -> tuple[Point, ...]:
    x, y = DRAWING_EDGE + LEFT_MARGIN / 2.0, tail.y + tail.height / 2.0
    return (tail.x, y), (x, y), (x, tip.y if tail.row < tip.row else tip.bottom)
