"""The figures of a fault's values and of the times to hazards."""

import math

import pandas as pd

from mutator.figures.fault_value_and_hazard_time_figures import draw_times_to_hazard, draw_values
from mutator.figures.golden_and_faulty_plot import render_images

POINTS = pd.DataFrame(
    {
        "value": [1.0, 2.0, 3.0],
        "y": [4.0, -1.0, 2.0],
        "scenario": ["S1", "S1", "S2"],
        "is_hazard": [False, True, False],
    }
)


def frame(*times: float) -> pd.DataFrame:
    return pd.DataFrame({"time_to_hazard": [*times, math.nan]})


def test_scenarios_differ_by_colour_and_shape_and_hazards_are_filled() -> None:
    [axis] = draw_values(POINTS, title="", x_label="x", y_label="y", limits=[(0.0, "limit of H1")]).axes
    *marks, limit = axis.lines
    looks = {line.get_label(): (line.get_color(), line.get_marker()) for line in marks}
    assert looks["S1"] == looks["S1, no hazard"]
    assert all(a != b for a, b in zip(looks["S1"], looks["S2, no hazard"], strict=True))
    assert [line.get_markerfacecolor() == "none" for line in marks] == [True, False, True]
    assert list(limit.get_ydata()) == [0.0, 0.0]
    assert [text.get_text() for text in axis.texts] == ["limit of H1"]


def test_the_shares_at_the_reaction_time_are_in_the_legend() -> None:
    figure = draw_times_to_hazard(frame(0.5, 1.8, 3.0), frame(3.0), 1.8)
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert labels[0].startswith("all faults: 66.7 % (2/3;") and labels[0].endswith("within 1.8 s")
    assert labels[1].startswith("this fault: 0.0 % (0/1;")


def test_a_run_without_hazards_can_be_drawn_again_with_the_same_bytes() -> None:
    images = [render_images(draw_times_to_hazard(frame(), None, 2.0), ["svg"]) for _ in range(2)]
    assert images[0] == images[1]
