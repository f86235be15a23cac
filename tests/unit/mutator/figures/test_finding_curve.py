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


def test_curves_of_random_searches_have_the_same_axes() -> None:
    """The longest search and the most findings give the axes; each curve ends at its own last run."""
    root = ElementTree.fromstring(draw_finding_curve([1, 2], [[0, 0, 1, 1], [5]]))
    assert root.get("aria-label") == "2 findings after 2 runs, drawn at random 1, 5"
    curves = {path.get("d", ""): path.get("class") for path in root.iter() if path.get("class") != "axis"}
    ends = [d.rpartition("H")[2] for d in curves if d]
    assert ends == ["194", "344", "119"]
    assert [name for d, name in curves.items() if d] == ["border", "border before", "border before"]
    assert {"5", "4"} <= {text.text for text in root.iter() if text.tag.endswith("text")}
