"""The curve of a search: well-formed, with its numbers, and a step for each new finding."""

from xml.etree import ElementTree

import pytest

from mutator.figures.finding_curve import draw_finding_curve


@pytest.mark.parametrize("counts", [[0], [1], [0, 1, 1, 2, 4], list(range(300))])
def test_a_curve_has_its_ends_and_steps(counts: list[int]) -> None:
    root = ElementTree.fromstring(draw_finding_curve(counts))
    assert root.get("aria-label") == f"{counts[-1]} findings after {len(counts)} runs"
    [curve] = [path.get("d", "") for path in root.iter() if path.get("class") == "border"]
    assert curve.count("V") == 1 + len(set(counts) - {0})
