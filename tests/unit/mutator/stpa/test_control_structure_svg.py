"""The diagram of the control structure."""

from itertools import combinations, pairwise
from pathlib import Path
from xml.etree import ElementTree

import pytest

import mutator
from mutator.stpa.control_structure_layout import (
    MIN_ARROW_DISTANCE,
    ComponentBox,
    Point,
    StructureLayout,
    lay_out_structure,
)
from mutator.stpa.control_structure_svg import (
    FAULT_COLOUR,
    factors_with_faults_by_place,
    join_with_common_prefix,
    render_structure,
)
from mutator.stpa.hazard_analysis_yaml import HazardAnalysis, load_hazard_analysis
from mutator.workspace import Workspace

CLONE = Path(__file__).parents[4]


@pytest.fixture(scope="module")
def analysis(clone: Workspace) -> HazardAnalysis:
    return load_hazard_analysis(clone.library / "stpa")


@pytest.fixture(scope="module")
def layout(analysis: HazardAnalysis) -> StructureLayout:
    return lay_out_structure(analysis.structure)


def meets(box: ComponentBox, start: Point, end: Point) -> bool:
    """Whether a horizontal or vertical segment has a point inside the box."""
    (x1, x2), (y1, y2) = sorted((start[0], end[0])), sorted((start[1], end[1]))
    return x1 < box.x + box.width and x2 > box.x and y1 < box.bottom and y2 > box.y


def test_boxes_do_not_overlap_and_are_inside(layout: StructureLayout) -> None:
    for one, other in combinations(layout.box_by_component.values(), 2):
        assert not meets(one, (other.x, other.y), (other.x + other.width, other.bottom))
    for box in layout.box_by_component.values():
        assert box.x >= 0 and box.x + box.width < layout.width and box.bottom < layout.height


def test_arrows_join_their_boxes_and_cross_no_other_box(
    analysis: HazardAnalysis, layout: StructureLayout
) -> None:
    for name, link in analysis.structure.links.items():
        points = layout.arrow_by_link[name].corners
        for place, point in ((link.from_, points[0]), (link.to, points[-1])):
            box = layout.box_by_component[place]
            assert point[1] in (box.y, box.bottom) or point[0] in (box.x, box.x + box.width), name
        for box in layout.box_by_component.values():
            assert not any(meets(box, start, end) for start, end in pairwise(points)), name


def test_arrows_do_not_overlap(layout: StructureLayout) -> None:
    for (one, first), (other, second) in combinations(layout.arrow_by_link.items(), 2):
        for a, b in pairwise(first.corners):
            for c, d in pairwise(second.corners):
                for i in (0, 1):  # along x, along y
                    if a[1 - i] == b[1 - i] and c[1 - i] == d[1 - i]:
                        together = min(max(a[i], b[i]), max(c[i], d[i])) > max(
                            min(a[i], b[i]), min(c[i], d[i])
                        )
                        assert not together or abs(a[1 - i] - c[1 - i]) >= MIN_ARROW_DISTANCE - 8, (
                            one,
                            other,
                        )


def test_labels_overlap_nothing(analysis: HazardAnalysis, layout: StructureLayout) -> None:
    areas = {}
    for name, link in analysis.structure.links.items():
        arrow, width = layout.arrow_by_link[name], 7.0 * len(link.label)
        (x, y), apart = arrow.label.baseline, arrow.label.line_distance
        left = x - {"start": 0.0, "middle": width / 2, "end": width}[arrow.label.anchor]
        areas[name] = ComponentBox(x=left, y=y - 12, width=width, height=apart + 15, row=0, text_lines=())
    for (name, area), (other, beside) in combinations(areas.items(), 2):
        assert not meets(area, (beside.x, beside.y), (beside.x + beside.width, beside.bottom)), (name, other)
    for name, area in areas.items():
        for box in layout.box_by_component.values():
            assert not meets(area, (box.x, box.y), (box.x + box.width, box.bottom)), name
        for other, arrow in layout.arrow_by_link.items():
            if other != name:
                assert not any(meets(area, a, b) for a, b in pairwise(arrow.corners)), (name, other)


def test_only_places_with_faults_have_the_colour_of_faults(analysis: HazardAnalysis) -> None:
    text = render_structure(analysis)
    assert text == render_structure(analysis)
    root = ElementTree.fromstring(text)
    lines = [e for e in root.iter("{http://www.w3.org/2000/svg}path") if e.get("stroke") == FAULT_COLOUR]
    links = factors_with_faults_by_place(analysis).keys() & analysis.structure.links.keys()
    assert len(lines) == len(links) + 1  # the links and the legend's line
    words = [e.text for e in root.iter("{http://www.w3.org/2000/svg}text")]
    assert {"ACC", "LKAS", "steer torque", "CF13, 14"} <= set(words)


def test_the_diagram_in_the_docs_is_current(analysis: HazardAnalysis) -> None:
    """After a change, run `mutator stpa --svg docs/explanation/hazard-analysis.svg`."""
    assert (CLONE / "docs" / "explanation" / "hazard-analysis.svg").read_text() == render_structure(analysis)


def test_a_common_prefix_is_written_once() -> None:
    assert join_with_common_prefix(["CF9"]) == "CF9"
    assert join_with_common_prefix(["CF9", "CF10"]) == "CF9, 10"


@pytest.mark.parametrize("mark", ["<marker", '" L".join', "arrow.label.anchor"])
def test_one_module_draws_the_arrows_of_all_drawings(mark: str) -> None:
    sources = Path(mutator.__file__).parent
    assert [path.name for path in sources.rglob("*.py") if mark in path.read_text()] == [
        "arrow_and_box_svg.py"
    ]
